!> The numbers of Step 2 by their names: what is stored beside its document, and what figures are made of.
module extraction_values
   use extraction, only: extraction_type
   use kinds, only: wp
   use named_values, only: named_values_type
   use problem, only: problem_type
   implicit none
   private
   public :: put_extraction

contains

   !> The `document`, what it is about, and numbers. Chains: 'draws' (parameter, sample, chain), 'log_density' (sample, chain),
   !> 'acceptance' (chain), 'prior_draws'; of some draws, 'stride'
   !> apart, 'predicted', 'log_likelihood', 'replicated' (grain, draw, chain), 'factor' (group, draw, chain), 'quantities' (quantity, draw,
   !> chain), 'log_prior' (draw, chain); of each parameter 'most_probable', NaN where it is outside the interval; and the prior's limits.
   subroutine put_extraction(problem, found, document, out)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      !> JSON.
      character(len=*), intent(in) :: document
      type(named_values_type), intent(inout) :: out

      call out%put('document', document)
      call out%put('resolved', problem%resolved_text())
      call out%put('symmetry', trim(problem%class%name))
      call out%put('title', problem%settings%problem%title)
      call out%put('modulus_kind', problem%settings%measurements%modulus_kind)
      associate (measured => problem%measurements)
         call out%put_array('euler_deg', measured%euler_deg, shape(measured%euler_deg))
         call out%put_array('modulus_gpa', measured%modulus_gpa, [measured%n])
         call out%put_array('sd_gpa', measured%sd_gpa, [measured%n])
      end associate
      associate (chains => found%chains, checks => found%checks, predictions => found%predictions, prior => found%posterior%prior)
         call out%put_array('draws', chains%draws, shape(chains%draws))
         call out%put_array('log_density', chains%log_density, shape(chains%log_density))
         call out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
         call out%put_array('prior_draws', found%prior_chains%draws, shape(found%prior_chains%draws))
         call out%put_array('predicted', predictions%moduli, shape(predictions%moduli))
         call out%put_array('factor', predictions%factor, shape(predictions%factor))
         call out%put_array('quantities', predictions%quantities, shape(predictions%quantities))
         call out%put('stride', predictions%stride)
         call out%put_array('log_likelihood', checks%log_likelihood, shape(checks%log_likelihood))
         call out%put_array('replicated', checks%replicated, shape(checks%replicated))
         call out%put_array('log_prior', checks%log_prior, shape(checks%log_prior))
         call out%put_array('most_probable', found%most_probable, shape(found%most_probable))
         call out%put_array('lower', prior%lower, shape(prior%lower))
         call out%put_array('upper', prior%upper, shape(prior%upper))
         call out%put('anisotropy_cap', prior%anisotropy_cap)
         call out%put('share_inside', prior%share_inside)
      end associate
   end subroutine put_extraction
end module extraction_values
