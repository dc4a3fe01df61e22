!> Rivals of what is stated beside the table: the kind of modulus, the knowledge, and the limits of
!> the prior.
module statement_rivals
   use constants_posterior, only: posterior_type
   use constants_prior, only: knowledge_type
   use kinds, only: wp
   use model_evidence, only: fit_model, fit_type
   use observables, only: modulus_kinds
   use rival_cases, only: case_type, rival_type
   use text, only: to_text
   implicit none
   private
   public :: make_kind, make_knowledge, make_limits, part_of

contains

   !> The moduli are of the kind k.
   subroutine make_kind(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival

      if (k > size(modulus_kinds)) return
      rival%explanation = 'moduli of the kind '//trim(modulus_kinds(k))
      rival%remedy = 'modulus_kind = '''//trim(modulus_kinds(k))//''''
      rival%settings%modulus_kind = trim(modulus_kinds(k))
      rival%differs = case%stated%settings%modulus_kind /= modulus_kinds(k)
   end subroutine make_kind

   !> The known quantity k is of another crystal, which has the default prior; after the last
   !> quantity: all of them are.
   subroutine make_knowledge(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      logical, allocatable :: is_other(:)
      integer :: i, n

      associate (known => case%stated%prior%knowledge)
         n = size(known%mean)
         if (k > n .and. (n < 2 .or. k > n + 1)) return
         rival%explanation = 'all knowledge'
         rival%remedy = 'leave out &knowledge'
         is_other = [(k == i .or. k > n, i=1, n)]
         if (k <= n) then
            rival%explanation = known%quantities(k)%name//' = '//to_text(known%mean(k), 4)
            rival%remedy = rival%remedy//' '//known%quantities(k)%name
            ! Correlated quantities are of one source.
            if (any(abs(known%covariance(k, :)) > 0.0_wp .and. .not. is_other)) is_other = .false.
         end if
         rival%explanation = rival%explanation//' of another crystal'
         if (.not. any(is_other)) return
         allocate (rival%posterior, source=case%stated)
         call rival%posterior%prior%set_knowledge(part_of(known, .not. is_other), rival%error)
         if (.not. allocated(rival%error)) call set_rest(part_of(known, is_other))
      end associate

   contains

      !> Set the density of the knowledge of another crystal.
      subroutine set_rest(other)
         type(knowledge_type), intent(in) :: other
         type(posterior_type) :: alone
         type(fit_type) :: fit

         alone = case%stated
         alone%prior = alone%prior%without_limits()
         alone%prior_only = .true.
         call alone%prior%set_knowledge(other, rival%error)
         if (allocated(rival%error)) return
         call fit_model(alone, case%crystal, .true., .false., fit)
         rival%log_rest = fit%log_z
         if (.not. fit%found) deallocate (rival%posterior)
      end subroutine set_rest
   end subroutine make_knowledge

   !> The quantities of a mask.
   function part_of(known, mask) result(part)
      type(knowledge_type), intent(in) :: known
      logical, intent(in) :: mask(:)
      type(knowledge_type) :: part
      integer :: i
      integer, allocatable :: kept(:)

      kept = pack([(i, i=1, size(mask))], mask)
      part%quantities = known%quantities(kept)
      part%mean = known%mean(kept)
      part%covariance = known%covariance(kept, kept)
   end function part_of

   !> The default prior without the stated limits (1), or with wider sds (2).
   subroutine make_limits(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      !> Factor on the sds of contrast and anisotropy.
      real(wp), parameter :: widening = 3.0_wp

      if (k > 2) return
      rival%explanation = 'crystals beyond the limits of the prior'
      rival%remedy = 'leave out the limits of &prior'
      if (k == 2) then
         rival%explanation = 'a crystal that the default prior takes as improbable'
         rival%remedy = 'c_min and c_max of all constants'
      end if
      if (merge(case%stated%prior%has_default, case%stated%prior%is_cut(), k == 2)) then
         allocate (rival%posterior, source=case%stated)
         if (k == 1) rival%posterior%prior = rival%posterior%prior%without_limits()
         if (k == 2) rival%posterior%prior%width = widening
      end if
   end subroutine make_limits
end module statement_rivals
