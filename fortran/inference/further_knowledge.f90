!> What knowing more would bring: the sds of the constants if some quantities, which indentation
!> does not see, were known as well.
!>
!> From the draws at hand: each of some of them in turn is taken for the truth, all are weighted by
!> the normal factors that this knowledge would be, and the sds that are left are averaged. Where
!> too few draws have weight, the covariance is used (linear update). What follows from &knowledge
!> or from a quantity before it in every crystal of the class is left out. How well a modulus would
!> be known is an sd in GPa, since its true value may be far from its mean here, and the sds that
!> are left follow what is stated.
!>
!> And how far what &knowledge says is from what all else says, in sds.
!>
!> The misfit is minus twice the logarithm of likelihood and normal factors, and D by how much its
!> least value over the support grows if the factors are there. For one normal factor m ± s of a
!> quantity of which all else says M ± S, D = (M - m)²/(S² + s²). It does not depend on where the
!> prior has its volume. Of each of several quantities the same comes from mean and variance given
!> everything, its factor included, |E q - m|/sqrt(s² - Var q), and cannot be more than the root of
!> D.
module further_knowledge
   use constants_posterior, only: posterior_type
   use constants_prior, only: knowledge_type, prior_type
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use quantities, only: check_distinct, evaluate_draws, new_quantities, quantity_type
   use samplers, only: chains_type
   use posterior_summary, only: find_maximum
   use small_matrices, only: solve_lower
   use statistics, only: covariance_of, flattened, moments, thinned
   use text, only: split_list
   implicit none
   private
   public :: gain_type, expect_gains, conflict_type, find_conflict, without_knowledge

   type :: gain_type
      !> What would be known, and how well: relative sd, and of a modulus (else 0) the same of its
      !> mean here, GPa.
      character(len=80) :: name = ''
      real(wp) :: relative_sd = 0.02_wp, known_sd = 0.0_wp
      !> sds of the constants now and then, GPa, (n_constants).
      real(wp), allocatable :: sd_now(:), sd_then(:)
   end type gain_type

   !> The quantities that come from elsewhere: one kind a row, and the quantities that belong to it.
   character(len=*), parameter :: kinds(3) = [character(len=64) :: 'bulk_modulus', &
      & 'polycrystal_young', 'compressibility[100], compressibility[010], compressibility[001]']
   integer, parameter :: most_draws = 8000, anchors = 40, least_size = 30

   type :: conflict_type
      !> D, and the sds of a normal variable that are as improbable as a chi-square of as many
      !> degrees as quantities.
      real(wp) :: growth = 0.0_wp, sds = 0.0_wp
      !> Of each quantity, in sds.
      real(wp), allocatable :: of_quantity(:)
   end type conflict_type

   !> s² - Var q is at least this share of s²: less is the noise of the draws.
   real(wp), parameter :: least_share = 0.05_wp

contains

   !> What each kind of knowledge would bring.
   subroutine expect_gains(prior, draws, gains)
      type(prior_type), intent(in) :: prior
      !> (parameter, sample, chain), the first parameters constants.
      real(wp), intent(in) :: draws(:, :, :)
      type(gain_type), allocatable, intent(out) :: gains(:)
      type(error_type), allocatable :: error
      type(gain_type) :: gain
      type(quantity_type), allocatable :: named(:), known(:), list(:)
      real(wp), allocatable :: values(:, :), constants(:, :)
      integer :: i, k

      constants = flattened(thinned(draws(:prior%n_constants, :, :), most_draws))
      allocate (gains(0))
      known = prior%knowledge%quantities
      do k = 1, size(kinds)
         call new_quantities(split_list(trim(kinds(k))), prior%class, 0, named, error)
         list = named(:0)
         do i = 1, size(named)
            call check_distinct([known, named(i)], prior%class, error)
            if (.not. allocated(error)) list = [list, named(i)]
         end do
         if (size(list) == 0) cycle
         known = [known, list]
         gain = gain_type(name=list(1)%name)
         do i = 2, size(list)
            gain%name = trim(gain%name)//', '//list(i)%name
         end do
         call evaluate_draws(list, prior%class, constants, values)
         if (list(1)%unit == 'GPa') gain%known_sd = gain%relative_sd*sum(values)/size(values)
         call expect_sds(constants, values, gain)
         gains = [gains, gain]
      end do
   end subroutine expect_gains

   subroutine expect_sds(constants, values, gain)
      !> (constant, draw), GPa; (quantity, draw).
      real(wp), intent(in) :: constants(:, :), values(:, :)
      type(gain_type), intent(inout) :: gain
      real(wp), dimension(size(constants, 1)) :: variance, mean, sd
      real(wp) :: weights(size(values, 2)), known_sd
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
            known_sd = merge(gain%known_sd, gain%relative_sd*values(i, anchor), &
               & gain%known_sd > 0.0_wp)
            weights = weights*exp(-0.5_wp*((values(i, :) - values(i, anchor))/known_sd)**2)
         end do
         weights = weights/sum(weights)
         if (1.0_wp/sum(weights**2) < least_size) cycle
         used = used + 1
         call moments(constants, mean, sd, weights)
         variance = variance + sd**2
      end do
      gain%sd_then = linear_update(constants, values, gain%relative_sd)
      if (2*used >= anchors) gain%sd_then = sqrt(variance/used)
   end subroutine expect_sds

   !> sds of normal variables with the covariance of the draws after measurements of the quantities.
   function linear_update(constants, values, relative_sd) result(sd)
      real(wp), intent(in) :: constants(:, :), values(:, :), relative_sd
      real(wp) :: sd(size(constants, 1))
      real(wp) :: joint(size(values, 1) + size(sd), size(values, 1) + size(sd)), &
         & own(size(values, 1), size(values, 1))
      real(wp) :: cross(size(values, 1))
      type(error_type), allocatable :: error
      integer :: i, q

      q = size(values, 1)
      joint = covariance_of(transpose(reshape([transpose(values), transpose(constants)], &
         & [size(values, 2), size(joint, 1)])))
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

   !> The density without any knowledge.
   subroutine without_knowledge(posterior, free, error)
      type(posterior_type), intent(in) :: posterior
      type(posterior_type), intent(out) :: free
      type(error_type), allocatable, intent(out) :: error
      type(knowledge_type) :: nothing

      allocate (nothing%quantities(0), nothing%mean(0), nothing%covariance(0, 0))
      free = posterior
      call free%prior%set_knowledge(nothing, error)
   end subroutine without_knowledge

   !> Compare what is known with all else.
   subroutine find_conflict(posterior, chains, free_chains, conflict, error)
      type(posterior_type), intent(in) :: posterior
      !> Of it, and of the density without knowledge.
      type(chains_type), intent(in) :: chains, free_chains
      type(conflict_type), intent(out) :: conflict
      type(error_type), allocatable, intent(out) :: error
      type(posterior_type) :: all, free
      integer, parameter :: few = 4000
      real(wp), allocatable :: values(:, :)
      real(wp), dimension(size(posterior%prior%knowledge%mean)) :: mean, sd
      real(wp) :: point(posterior%dimension), other(posterior%dimension), most, &
         & most_free, most_other
      integer :: n

      n = size(mean)
      allocate (conflict%of_quantity(n))
      if (n == 0) return
      all = posterior
      all%prior%in_logarithms = .false.
      call without_knowledge(all, free, error)
      if (allocated(error)) return
      point = chains%best_draw()
      call restart_search(all, chains, point, most)
      other = free_chains%best_draw()
      call restart_search(free, free_chains, other, most_other)
      ! What is best with knowledge is a point to start from without.
      call restart_search(free, chains, point, most_free)
      conflict%growth = 2.0_wp*max(0.0_wp, max(most_free, most_other) - most)
      conflict%sds = sds_of(conflict%growth, n)
      associate (knowledge => posterior%prior%knowledge)
         call evaluate_draws(knowledge%quantities, posterior%prior%class, &
            & flattened(thinned(chains%draws, few)), values)
         call moments(values, mean, sd)
         mean = (mean - knowledge%mean)/knowledge%sd()
         sd = sd/knowledge%sd()
      end associate
      conflict%of_quantity = min(abs(mean)/sqrt(max(least_share, 1.0_wp - sd**2)), &
         & sqrt(conflict%growth))
      if (n == 1) conflict%of_quantity = sqrt(conflict%growth)
   end subroutine find_conflict

   !> Simplices one after another until the next adds nothing.
   subroutine restart_search(density, chains, point, log_density)
      type(posterior_type), intent(in) :: density
      type(chains_type), intent(in) :: chains
      real(wp), intent(inout) :: point(:)
      real(wp), intent(out) :: log_density
      integer, parameter :: most = 8
      real(wp), parameter :: nothing = 0.05_wp
      real(wp) :: before, values(1)
      integer :: i

      call density%evaluate(reshape(point, [size(point), 1]), values)
      do i = 1, most
         before = values(1)
         call find_maximum(density, chains, point)
         call density%evaluate(reshape(point, [size(point), 1]), values)
         if (values(1) - before < nothing) exit
      end do
      log_density = values(1)
   end subroutine restart_search

   !> Wilson and Hilferty's normal variable of a chi-square; exactly its root for one degree of
   !> freedom.
   pure real(wp) function sds_of(chi_square, degrees)
      real(wp), intent(in) :: chi_square
      integer, intent(in) :: degrees
      real(wp) :: spread

      spread = 2.0_wp/(9.0_wp*degrees)
      sds_of = max(0.0_wp, ((chi_square/degrees)**(1.0_wp/3.0_wp) - 1.0_wp + spread)/sqrt(spread))
      if (degrees == 1) sds_of = sqrt(chi_square)
   end function sds_of

end module further_knowledge
