!> How far what &knowledge says is from what all else says, in sds.
!>
!> The misfit is minus twice the logarithm of likelihood and normal factors, and D by how much its least value over the support grows if
!> the factors are there. For one normal factor m ± s of a quantity of which all else says M ± S, D = (M - m)²/(S² + s²). It does not
!> depend on where the prior has its volume. Of each of several quantities the same comes from mean and variance given everything, its
!> factor included, |E q - m|/sqrt(s² - Var q), and cannot be more than the root of D.
module knowledge_conflict
   use constants_posterior, only: posterior_type
   use constants_prior, only: knowledge_type
   use errors, only: error_type
   use kinds, only: wp
   use quantities, only: evaluate_draws
   use samplers, only: chains_type
   use simplex_search, only: climb
   use statistics, only: flattened, moments, thinned
   implicit none
   private
   public :: conflict_type, find_conflict, without_knowledge

   type :: conflict_type
      !> D, and the sds of a normal variable that are as improbable as a chi-square of as many degrees as quantities.
      real(wp) :: growth = 0.0_wp, sds = 0.0_wp
      !> Of each quantity, in sds.
      real(wp), allocatable :: of_quantity(:)
   end type conflict_type

   !> s² - Var q is at least this share of s²: less is the noise of the draws.
   real(wp), parameter :: least_share = 0.05_wp

contains

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
      real(wp) :: point(posterior%dimension), other(posterior%dimension), most, most_free, most_other
      integer :: n

      n = size(posterior%prior%knowledge%mean)
      allocate (conflict%of_quantity(n))
      if (n == 0) return
      all = posterior
      all%prior%in_logarithms = .false.
      all%prior%has_default = .false.
      call without_knowledge(all, free, error)
      if (allocated(error)) return
      point = chains%best_draw()
      call climb_up(all, chains, point, most)
      other = free_chains%best_draw()
      call climb_up(free, free_chains, other, most_other)
      ! What is best with knowledge is a point to start from without.
      call climb_up(free, chains, point, most_free)
      conflict%growth = 2.0_wp*max(0.0_wp, max(most_free, most_other) - most)
      conflict%sds = sds_of(conflict%growth, n)
      call compare_moments(posterior, chains, conflict)
      if (n == 1) conflict%of_quantity = sqrt(conflict%growth)
   end subroutine find_conflict

   !> Simplices one after another until the next adds nothing, whose first steps are a tenth of the sds of the parameters in chains.
   subroutine climb_up(density, chains, point, log_density)
      type(posterior_type), intent(in) :: density
      type(chains_type), intent(in) :: chains
      real(wp), intent(inout) :: point(:)
      real(wp), intent(out) :: log_density
      integer, parameter :: most = 8
      real(wp), parameter :: nothing = 0.05_wp
      real(wp) :: before, values(1), mean(size(point)), sd(size(point))
      integer :: i

      call moments(flattened(chains%draws), mean, sd)
      call density%evaluate(reshape(point, [size(point), 1]), values)
      do i = 1, most
         before = values(1)
         call climb(density, 0.1_wp*sd, point)
         call density%evaluate(reshape(point, [size(point), 1]), values)
         if (values(1) - before < nothing) exit
      end do
      log_density = values(1)
   end subroutine climb_up

   !> The conflict of each quantity, from mean and variance over some of the draws.
   subroutine compare_moments(posterior, chains, conflict)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      type(conflict_type), intent(inout) :: conflict
      integer, parameter :: most = 4000
      real(wp), dimension(size(conflict%of_quantity)) :: mean, sd
      real(wp), allocatable :: values(:, :)

      associate (knowledge => posterior%prior%knowledge)
         call evaluate_draws(knowledge%quantities, posterior%prior%class, flattened(thinned(chains%draws, most)), values)
         call moments(values, mean, sd)
         mean = (mean - knowledge%mean)/knowledge%sd()
         sd = sd/knowledge%sd()
      end associate
      conflict%of_quantity = min(abs(mean)/sqrt(max(least_share, 1.0_wp - sd**2)), sqrt(conflict%growth))
   end subroutine compare_moments

   !> Wilson and Hilferty's normal variable of a chi-square; exactly its root for one degree of freedom.
   pure real(wp) function sds_of(chi_square, degrees)
      real(wp), intent(in) :: chi_square
      integer, intent(in) :: degrees
      real(wp) :: spread

      spread = 2.0_wp/(9.0_wp*degrees)
      sds_of = max(0.0_wp, ((chi_square/degrees)**(1.0_wp/3.0_wp) - 1.0_wp + spread)/sqrt(spread))
      if (degrees == 1) sds_of = sqrt(chi_square)
   end function sds_of
end module knowledge_conflict
