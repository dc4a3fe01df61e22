!> Expected gain from further knowledge: the sds of the constants if some quantities that
!> indentation does not see were known as well.
!>
!> The gain follows from the covariance of the draws (linear update). A quantity that follows from
!> &knowledge, or from an earlier one, in every crystal of the class is left out. The accuracy of a
!> modulus is an sd in GPa, since its true value may be far from its mean here, and the sds that
!> result scale with it.
!>
!> Conflict of the knowledge with all other information (measurements and the rest of the prior), in
!> sds.
!>
!> The misfit is minus twice the logarithm of likelihood and normal factors. D is the growth of its
!> least value over the support when the factors are added. For one normal factor m ± s of a
!> quantity, for which all other information gives M ± S, D = (M - m)²/(S² + s²). D does not depend
!> on where the prior has its volume. For each of several quantities the same ratio follows from
!> mean and variance given everything, the factor included: |E q - m|/sqrt(s² - Var q). It cannot
!> exceed the root of D.
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
   use statistics, only: covariance_of, moments, thinned
   use text, only: split_list
   implicit none
   private
   public :: gain_type, expect_gains, conflict_type, find_conflict, without_knowledge

   type :: gain_type
      !> Names of the quantities, the relative sd with which they would be known, and for a modulus
      !> that sd times its mean here, GPa (else 0).
      character(len=80) :: name = ''
      real(wp) :: relative_sd = 0.02_wp, known_sd = 0.0_wp
      !> Standard deviations of the constants without and with the knowledge, GPa, (n_constants).
      real(wp), allocatable :: sd_now(:), sd_then(:)
   end type gain_type

   !> Quantities that other experiments or tables provide: one kind in a row, with the quantities
   !> that belong to it.
   character(len=*), parameter :: kinds(3) = [character(len=64) :: 'bulk_modulus', &
      & 'polycrystal_young', 'compressibility[100], compressibility[010], compressibility[001]']
   !> Draws that are used.
   integer, parameter :: most_draws = 8000

   type :: conflict_type
      !> D, and the deviation of a normal variable, in sds, that is as improbable as a chi-square of
      !> D with as many degrees of freedom as quantities.
      real(wp) :: growth = 0.0_wp, sds = 0.0_wp
      !> Conflict of each quantity, in sds.
      real(wp), allocatable :: of_quantity(:)
   end type conflict_type

   !> Least share of s² that s² - Var q is set to: a smaller one is noise of the draws.
   real(wp), parameter :: least_share = 0.05_wp

contains

   !> Estimate the gain from each kind of knowledge.
   subroutine expect_gains(prior, draws, gains)
      type(prior_type), intent(in) :: prior
      !> (parameter, sample, chain); the first parameters are the constants.
      real(wp), intent(in) :: draws(:, :, :)
      type(gain_type), allocatable, intent(out) :: gains(:)
      type(error_type), allocatable :: error
      type(gain_type) :: gain
      type(quantity_type), allocatable :: of_kind(:), known(:), new(:)
      !> (quantity, draw); (constant, draw), GPa.
      real(wp), allocatable :: values(:, :), constants(:, :)
      integer :: i, k

      constants = thinned(draws(:prior%n_constants, :, :), most_draws)
      allocate (gains(0))
      known = prior%knowledge%quantities
      do k = 1, size(kinds)
         call new_quantities(split_list(trim(kinds(k))), prior%class, 0, of_kind, error)
         new = of_kind(:0)
         do i = 1, size(of_kind)
            call check_distinct([known, of_kind(i)], prior%class, error)
            if (.not. allocated(error)) new = [new, of_kind(i)]
         end do
         if (size(new) == 0) cycle
         known = [known, new]
         gain = gain_type(name=new(1)%name)
         do i = 2, size(new)
            gain%name = trim(gain%name)//', '//new(i)%name
         end do
         call evaluate_draws(new, prior%class, constants, values)
         if (new(1)%unit == 'GPa') gain%known_sd = gain%relative_sd*sum(values)/size(values)
         call update_sds()
         gains = [gains, gain]
      end do

   contains

      !> Set the sds of normal variables with the covariance of the draws, and those after
      !> measurements of the quantities.
      subroutine update_sds()
         real(wp), allocatable :: joint(:, :), innovation(:, :), cross(:)
         type(error_type), allocatable :: error
         integer :: i, q

         q = size(values, 1)
         joint = covariance_of(transpose(reshape([transpose(values), transpose(constants)], &
            & [size(values, 2), q + size(constants, 1)])))
         gain%sd_now = [(sqrt(joint(q + i, q + i)), i=1, size(constants, 1))]
         gain%sd_then = gain%sd_now
         innovation = joint(:q, :q)
         do i = 1, q
            innovation(i, i) = innovation(i, i) &
               & + (gain%relative_sd*sum(values(i, :))/size(values, 2))**2
         end do
         call cholesky_factor(innovation, error)
         if (allocated(error)) return
         do i = 1, size(constants, 1)
            cross = joint(:q, q + i)
            call solve_lower(innovation, cross)
            gain%sd_then(i) = sqrt(max(0.0_wp, joint(q + i, q + i) - sum(cross**2)))
         end do
      end subroutine update_sds
   end subroutine expect_gains

   !> The posterior without knowledge.
   subroutine without_knowledge(posterior, free, error)
      type(posterior_type), intent(in) :: posterior
      type(posterior_type), intent(out) :: free
      type(error_type), allocatable, intent(out) :: error
      type(knowledge_type) :: nothing

      allocate (nothing%quantities(0), nothing%mean(0), nothing%covariance(0, 0))
      free = posterior
      call free%prior%set_knowledge(nothing, error)
   end subroutine without_knowledge

   !> Measure the conflict of the knowledge with all other information.
   subroutine find_conflict(posterior, chains, free_chains, conflict, error)
      type(posterior_type), intent(in) :: posterior
      !> Chains of the posterior, and of that without knowledge.
      type(chains_type), intent(in) :: chains, free_chains
      type(conflict_type), intent(out) :: conflict
      type(error_type), allocatable, intent(out) :: error
      type(posterior_type) :: with_knowledge, free
      integer, parameter :: most_values = 4000
      real(wp), allocatable :: values(:, :)
      real(wp), dimension(size(posterior%prior%knowledge%mean)) :: mean, sd
      real(wp) :: point(posterior%dimension), other(posterior%dimension), greatest, &
         & greatest_free, greatest_other, width
      integer :: n

      n = size(mean)
      allocate (conflict%of_quantity(n))
      if (n == 0) return
      with_knowledge = posterior
      with_knowledge%prior%in_logarithms = .false.
      call without_knowledge(with_knowledge, free, error)
      if (allocated(error)) return
      point = chains%best_draw()
      call restart_search(with_knowledge, chains, point, greatest)
      other = free_chains%best_draw()
      call restart_search(free, free_chains, other, greatest_other)
      ! The search without knowledge also starts at the best point with knowledge.
      call restart_search(free, chains, point, greatest_free)
      conflict%growth = 2.0_wp*max(0.0_wp, max(greatest_free, greatest_other) - greatest)
      ! The approximation of Wilson and Hilferty; the root is exact for one degree of freedom.
      width = 2.0_wp/(9.0_wp*n)
      conflict%sds = max(0.0_wp, &
         & ((conflict%growth/n)**(1.0_wp/3.0_wp) - 1.0_wp + width)/sqrt(width))
      if (n == 1) conflict%sds = sqrt(conflict%growth)
      associate (knowledge => posterior%prior%knowledge)
         call evaluate_draws(knowledge%quantities, posterior%prior%class, &
            & thinned(chains%draws, most_values), values)
         call moments(values, mean, sd)
         mean = (mean - knowledge%mean)/knowledge%sd()
         sd = sd/knowledge%sd()
      end associate
      conflict%of_quantity = min(abs(mean)/sqrt(max(least_share, 1.0_wp - sd**2)), &
         & sqrt(conflict%growth))
      if (n == 1) conflict%of_quantity = sqrt(conflict%growth)
   end subroutine find_conflict

   !> Search for the maximum of the density near `point`, restarting the simplex until it gains
   !> nothing.
   subroutine restart_search(density, chains, point, log_density)
      type(posterior_type), intent(in) :: density
      type(chains_type), intent(in) :: chains
      real(wp), intent(inout) :: point(:)
      real(wp), intent(out) :: log_density
      integer, parameter :: most_restarts = 8
      !> A smaller gain in log density changes D by less than 0.1.
      real(wp), parameter :: negligible = 0.05_wp
      real(wp) :: before, values(1)
      integer :: i

      call density%evaluate(reshape(point, [size(point), 1]), values)
      do i = 1, most_restarts
         before = values(1)
         call find_maximum(density, chains, point)
         call density%evaluate(reshape(point, [size(point), 1]), values)
         if (values(1) - before < negligible) exit
      end do
      log_density = values(1)
   end subroutine restart_search

end module further_knowledge
