!> The prior that was in effect, and the surrogate, in a few lines for people.
module prior_text
   use constants_prior, only: prior_type
   use extraction, only: extraction_type
   use kinds, only: wp
   use text, only: fixed, to_text
   use posterior_diagnostics, only: known_text
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: describe_prior

contains

   !> Lines: measure and limits; bounds; what is known; the surrogate; the evidence, which depends on all of these.
   subroutine describe_prior(found, lines)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(out) :: lines(:)
      character(len=:), allocatable :: line
      integer :: j

      allocate (lines(0))
      associate (prior => found%posterior%prior)
         if (prior%has_default) then
            line = 'the default prior of crystals: log(3K/2G) is 1.07 ± 0.6, the anisotropy follows Student''s t, and the ' &
               & //'scale is that of the mean measurement within a factor of 5'
         else
            line = 'uniform in '//trim(merge('log K        ', 'the constants', prior%in_logarithms))//' over stable crystals'
         end if
         if (prior%anisotropy_cap < huge(prior%anisotropy_cap)) line = line//', anisotropy index (Eq. 14) up to ' &
            & //to_text(prior%anisotropy_cap)
         call warn(lines, line)
         line = ''
         do j = 1, prior%n_constants
            if (prior%is_stated(j)) line = line//', '//prior%class%constants(j)//' '//to_text(prior%lower(j))//' .. ' &
               & //to_text(prior%upper(j))
         end do
         if (len(line) > 0) call warn(lines, 'bounds in GPa: '//line(3:))
         line = ''
         do j = 1, size(prior%knowledge%mean)
            line = line//', '//known_text(prior%knowledge, j)
         end do
         if (len(line) > 0) call warn(lines, 'known: '//line(3:))
      end associate
      call warn(lines, 'surrogate: '//surrogate_text(found))
      if (allocated(found%evidence)) call warn(lines, 'evidence: log Z = '//fixed(found%evidence%log_z, 2)//' ± ' &
         & //fixed(found%evidence%sd, 2)//', to compare with other models of the same data. It depends on the limits above: ' &
         & //'where the data decide, a prior twice as wide has a log Z that is lower by 0.69')
   end subroutine describe_prior

   function surrogate_text(found) result(text)
      type(extraction_type), intent(in) :: found
      character(len=:), allocatable :: text

      text = ''
      if (found%field_degree > 0) text = 'the exact theory of the half-space, harmonics to degree '//to_text(found%field_degree) &
         & //', the worst grain off by '//fixed(100.0_wp*found%field_error, 1)//' % of its sd'
      if (found%simulations == 0) return
      if (len(text) > 0) text = text//'; times what was learnt from '
      text = text//to_text(found%simulations)//' simulations'
      if (len_trim(found%checksum) > 0) text = text//', checksum '//found%checksum
      text = text//', sd '//fixed(found%surrogate_sd, 2)//' GPa in the mean grain; it is valid for ' &
         & //fixed(100.0_wp*found%posterior%prior%share_inside, 0)//' % of the prior'
   end function surrogate_text
end module prior_text
