!> Rivals of another crystal class: those one step up or down the tree of symmetry, and those that
!> share the step up.
module class_rivals
   use constants_posterior, only: new_posterior, posterior_type
   use constants_prior, only: new_prior, prior_type
   use crystal_class, only: crystal_class_names, crystal_class_type, new_crystal_class
   use errors, only: error_type
   use kinds, only: wp
   use measured_grains, only: mean_modulus
   use quantities, only: check_quantity
   use rival_cases, only: case_type, rival_type
   use settings_schema, only: prior_settings_type
   use text, only: split_list
   implicit none
   private
   public :: make_class

contains

   !> The class k of the list of all names. A synonym repeats an earlier class and is none.
   subroutine make_class(case, k, rival, error)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(out) :: rival
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type), allocatable :: classes(:)
      character(len=:), allocatable :: names(:)
      type(crystal_class_type) :: class
      integer :: i

      allocate (names, source=split_list(crystal_class_names()))
      if (k > size(names)) return
      allocate (classes(0))
      do i = 1, size(names)
         call new_crystal_class(trim(names(i)), class, error)
         if (allocated(error)) return
         if (class%name == names(i)) classes = [classes, class]
      end do
      rival%explanation = trim(names(k))//' crystals'
      rival%remedy = 'symmetry = '''//trim(names(k))//''''
      do i = 1, size(classes)
         if (classes(i)%name /= names(k)) cycle
         if (is_near(classes, case%problem%class, classes(i))) then
            call change_class(case, classes(i), rival, error)
         end if
      end do
   end subroutine make_class

   !> Whether a class is a step up, a step down, or a step up and one down from another.
   logical function is_near(classes, from, to)
      type(crystal_class_type), intent(in) :: classes(:), from, to
      integer :: i

      is_near = is_step(classes, from, to) .or. is_step(classes, to, from)
      if (from%name == to%name) return
      do i = 1, size(classes)
         is_near = is_near .or. (is_step(classes, classes(i), from) &
            & .and. is_step(classes, classes(i), to))
      end do
   end function is_near

   !> Whether all crystals of the first class are of the second, and of no class in between.
   logical function is_step(classes, high, low)
      type(crystal_class_type), intent(in) :: classes(:), high, low
      integer :: i

      is_step = low%name /= high%name .and. low%includes(high)
      if (.not. is_step) return
      do i = 1, size(classes)
         associate (other => classes(i))
            if (other%name == low%name .or. other%name == high%name) cycle
            if (low%includes(other) .and. other%includes(high)) is_step = .false.
         end associate
      end do
   end function is_step

   !> Set the posterior of a class, unless knowledge is of constants that it does not have.
   subroutine change_class(case, class, rival, error)
      type(case_type), intent(in) :: case
      type(crystal_class_type), intent(in) :: class
      type(rival_type), intent(inout) :: rival
      type(error_type), allocatable, intent(out) :: error
      !> Poisson's ratio of an isotropic solid with the mean measurement.
      real(wp), parameter :: typical_poisson = 0.3_wp
      type(prior_type) :: prior
      integer :: i

      associate (stated => case%stated)
         do i = 1, size(stated%prior%knowledge%mean)
            call check_quantity(stated%prior%knowledge%quantities(i), class, error)
            if (allocated(error)) then
               deallocate (error)
               return
            end if
         end do
         call new_prior(case%surrogate%basis%domain, class, other_bounds(case, class), &
            & (1.0_wp - typical_poisson**2)*mean_modulus(stated%observable, stated%data), &
            & stated%prior%knowledge, prior, error)
         if (allocated(error)) then
            ! No crystal of the class is within the bounds or the domain.
            deallocate (error)
            return
         end if
         allocate (rival%posterior)
         call new_posterior(case%surrogate, prior, stated%settings, &
            & case%problem%settings%sampler%surrogate_variance == 'full', stated%data, &
            & rival%posterior, error)
         if (allocated(error)) then
            ! The surrogate has no crystals of the class.
            deallocate (error, rival%posterior)
            return
         end if
         if (stated%grains%has_theory) then
            call rival%posterior%set_field_degree(stated%grains%field_degree, error)
         end if
      end associate
   end subroutine change_class

   !> Settings of &prior for another class: each constant has the range that the stated bounds allow
   !> its entry of the stiffness. An entry that is zero in the stated class may be as large as the
   !> shear constants.
   function other_bounds(case, class) result(settings)
      type(case_type), intent(in) :: case
      type(crystal_class_type), intent(in) :: class
      type(prior_settings_type) :: settings
      real(wp), dimension(6, 6) :: low, high, part
      real(wp) :: unit(case%problem%class%n_constants), shear
      integer :: k

      settings = case%problem%settings%prior
      if (.not. (allocated(settings%c_min) .or. allocated(settings%c_max))) return
      low = 0.0_wp
      high = 0.0_wp
      associate (prior => case%stated%prior)
         do k = 1, prior%n_constants
            unit = 0.0_wp
            unit(k) = 1.0_wp
            part = prior%class%stiffness(unit)
            low = low + merge(part*prior%lower(k), part*prior%upper(k), part > 0.0_wp)
            high = high + merge(part*prior%upper(k), part*prior%lower(k), part > 0.0_wp)
         end do
      end associate
      shear = high(4, 4)
      where (.not. high > low)
         low = -shear
         high = shear
      end where
      settings%c_min = class%constants_of(low)
      settings%c_max = class%constants_of(high)
   end function other_bounds

end module class_rivals
