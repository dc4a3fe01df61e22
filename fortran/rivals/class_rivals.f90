!> Rivals of another crystal class: those of fewer constants, and those of at most about twice as
!> many. Classes of still lower symmetry explain hardly more than these.
module class_rivals
   use constants_posterior, only: new_posterior
   use constants_prior, only: new_prior, prior_type
   use crystal_class, only: crystal_class_names, crystal_class_type, new_crystal_class
   use quantities, only: check_quantity
   use rival_cases, only: case_type, rival_type
   use settings_schema, only: prior_settings_type
   use text, only: split_list
   implicit none
   private
   public :: make_class

contains

   !> The class k of the list of all names, with the default prior. A synonym repeats an earlier
   !> class and is none.
   subroutine make_class(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      character(len=:), allocatable :: names(:)
      type(crystal_class_type) :: class
      type(prior_type) :: prior
      integer :: i

      allocate (names, source=split_list(crystal_class_names()))
      if (k > size(names)) return
      rival%explanation = trim(names(k))//' crystals'
      rival%remedy = 'symmetry = '''//trim(names(k))//''''
      call new_crystal_class(trim(names(k)), class, rival%error)
      associate (own => case%problem%class, stated => case%stated)
         if (class%name /= names(k) .or. class%name == own%name &
            & .or. class%n_constants - own%n_constants > own%n_constants + 1) then
            return
         end if
         ! Knowledge may be of constants that the class does not have.
         do i = 1, size(stated%prior%knowledge%mean)
            call check_quantity(stated%prior%knowledge%quantities(i), class, rival%error)
            if (allocated(rival%error)) return
         end do
         call new_prior(case%surrogate%basis%domain, class, prior_settings_type(), &
            & stated%prior%typical_young, stated%prior%knowledge, prior, rival%error)
         if (allocated(rival%error)) return
         allocate (rival%posterior)
         call new_posterior(case%surrogate, prior, stated%settings, &
            & case%problem%settings%sampler%surrogate_variance == 'full', stated%data, &
            & rival%posterior, rival%error, stated)
      end associate
   end subroutine make_class
end module class_rivals
