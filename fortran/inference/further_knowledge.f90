!> What knowing more would bring: the sds of the constants if some quantities, which indentation does not see, were known as well.
!>
!> From the draws at hand: each of some of them in turn is taken for the truth, all are weighted by the normal factors that this
!> knowledge would be, and the sds that are left are averaged. Where too few draws have weight, the covariance tells (linear update). What
!> &knowledge states already is left out.
module further_knowledge
   use constants_prior, only: prior_type
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use quantities, only: evaluate_draws, new_quantity, quantity_type
   use small_matrices, only: solve_lower
   use statistics, only: covariance_of, flattened, moments, thinned
   use text, only: split_list
   implicit none
   private
   public :: gain_type, expect_gains

   type :: gain_type
      !> What would be known, and how well: relative sd.
      character(len=80) :: name = ''
      real(wp) :: relative_sd = 0.02_wp
      !> sds of the constants now and then, GPa, (n_constants).
      real(wp), allocatable :: sd_now(:), sd_then(:)
   end type gain_type

   !> The quantities that come from elsewhere: one kind a row, and the quantities that belong to it.
   character(len=*), parameter :: kinds(3) = [character(len=64) :: 'bulk_modulus', 'polycrystal_young', &
      & 'compressibility[100], compressibility[010], compressibility[001]']
   integer, parameter :: most_draws = 8000, anchors = 40, least_size = 30

contains

   !> What each kind of knowledge would bring.
   subroutine expect_gains(prior, draws, gains)
      type(prior_type), intent(in) :: prior
      !> (parameter, sample, chain), the first parameters constants.
      real(wp), intent(in) :: draws(:, :, :)
      type(gain_type), allocatable, intent(out) :: gains(:)
      type(error_type), allocatable :: error
      type(gain_type) :: gain
      character(len=:), allocatable :: names(:)
      type(quantity_type), allocatable :: list(:)
      real(wp), allocatable :: values(:, :), constants(:, :)
      logical, allocatable :: distinct(:)
      integer :: i, k

      constants = flattened(thinned(draws(:prior%n_constants, :, :), most_draws))
      allocate (gains(0))
      do k = 1, size(kinds)
         names = split_list(trim(kinds(k)))
         if (all([(is_stated(prior, trim(names(i))), i=1, size(names))])) cycle
         gain = gain_type()
         allocate (list(size(names)))
         do i = 1, size(names)
            call new_quantity(trim(names(i)), list(i), error)
         end do
         call evaluate_draws(list, prior%class, constants, values)
         call keep_distinct(values, distinct)
         do i = 1, size(names)
            if (.not. distinct(i)) cycle
            if (len_trim(gain%name) > 0) gain%name = trim(gain%name)//','
            gain%name = adjustl(trim(gain%name)//' '//names(i))
         end do
         call expect_sds(constants, values, gain)
         gains = [gains, gain]
         deallocate (list, values)
      end do
   end subroutine expect_gains

   !> Whether &knowledge has a quantity of this name.
   pure logical function is_stated(prior, name)
      type(prior_type), intent(in) :: prior
      character(len=*), intent(in) :: name
      integer :: i

      is_stated = .false.
      do i = 1, size(prior%knowledge%mean)
         is_stated = is_stated .or. prior%knowledge%quantities(i)%name == name
      end do
   end function is_stated

   !> Leave out quantities that are the same as another in every draw.
   subroutine keep_distinct(values, distinct)
      !> (quantity, draw).
      real(wp), allocatable, intent(inout) :: values(:, :)
      logical, allocatable, intent(out) :: distinct(:)
      real(wp), parameter :: same = 1.0e-9_wp
      integer :: i, j

      allocate (distinct(size(values, 1)), source=.true.)
      do i = 2, size(distinct)
         do j = 1, i - 1
            if (maxval(abs(values(i, :) - values(j, :))) <= same*maxval(abs(values(j, :)))) distinct(i) = .false.
         end do
      end do
      values = values(pack([(i, i=1, size(distinct))], distinct), :)
   end subroutine keep_distinct

   subroutine expect_sds(constants, values, gain)
      !> (constant, draw), GPa; (quantity, draw).
      real(wp), intent(in) :: constants(:, :), values(:, :)
      type(gain_type), intent(inout) :: gain
      real(wp), dimension(size(constants, 1)) :: variance, mean, sd
      real(wp) :: weights(size(values, 2))
      integer :: a, i, n, used, anchor

      n = size(values, 2)
      call moments(constants, mean, sd)
      gain%sd_now = sd
      variance = 0.0_wp
      used = 0
      do a = 1, anchors
         anchor = 1 + ((a - 1)*n)/anchors
         weights = 1.0_wp
         do i = 1, size(values, 1)
            weights = weights*exp(-0.5_wp*((values(i, :) - values(i, anchor))/(gain%relative_sd*values(i, anchor)))**2)
         end do
         weights = weights/sum(weights)
         if (1.0_wp/sum(weights**2) < least_size) cycle
         used = used + 1
         call moments(constants, mean, sd, weights)
         variance = variance + sd**2
      end do
      if (2*used >= anchors) then
         gain%sd_then = sqrt(variance/used)
      else
         gain%sd_then = linear_update(constants, values, gain%relative_sd)
      end if
   end subroutine expect_sds

   !> sds of normal variables with the covariance of the draws after measurements of the quantities.
   function linear_update(constants, values, relative_sd) result(sd)
      real(wp), intent(in) :: constants(:, :), values(:, :), relative_sd
      real(wp) :: sd(size(constants, 1))
      real(wp) :: joint(size(values, 1) + size(sd), size(values, 1) + size(sd)), own(size(values, 1), size(values, 1))
      real(wp) :: cross(size(values, 1))
      real(wp), allocatable :: both(:, :)
      type(error_type), allocatable :: error
      integer :: i, q

      q = size(values, 1)
      allocate (both(size(joint, 1), size(values, 2)))
      both(:q, :) = values
      both(q + 1:, :) = constants
      joint = covariance_of(both)
      sd = [(sqrt(joint(q + i, q + i)), i=1, size(sd))]
      own = joint(:q, :q)
      do i = 1, q
         own(i, i) = own(i, i) + (relative_sd*sum(values(i, :))/size(values, 2))**2
      end do
      call cholesky_factor(own, error)
      if (allocated(error)) return
      do i = 1, size(sd)
         cross = joint(:q, q + i)
         call solve_lower(own, cross)
         sd(i) = sqrt(max(0.0_wp, sd(i)**2 - sum(cross**2)))
      end do
   end function linear_update
end module further_knowledge
