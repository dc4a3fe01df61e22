!> posterior.bin: all numbers of Step 2 by their names, see `put_extraction`, with a checksum of all before it at the end.
module posterior_file
   use, intrinsic :: iso_c_binding, only: c_char
   use checksums, only: checksum
   use errors, only: error_type, refuse
   use extraction, only: extraction_type
   use files, only: file_exists, read_bytes, replace_file
   use kinds, only: wp
   use named_values, only: named_values_reader_type, named_values_type
   use problem, only: problem_type
   implicit none
   private
   public :: put_extraction, save_posterior, read_posterior, stored_draws

   character(len=*), parameter :: name = '/posterior.bin'
   integer, parameter :: digits = 16

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
   !> Write the numbers into a `folder`, with the `inputs` that they follow from.
   subroutine save_posterior(problem, found, document, folder, inputs, error)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      character(len=*), intent(in) :: document, folder, inputs
      type(error_type), allocatable, intent(out) :: error
      type(named_values_type) :: values

      call values%put('inputs', inputs)
      call put_extraction(problem, found, document, values)
      associate (content => values%bytes(:values%filled))
         call replace_file(folder//name, content//checksum(content), error)
      end associate
   end subroutine save_posterior

   !> The named values of a folder, as bytes (`content`); refused if they were changed.
   subroutine read_posterior(folder, content, error)
      character(len=*), intent(in) :: folder
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      call read_bytes(folder//name, content, error)
      if (allocated(error)) return
      n = len(content) - digits
      if (n > 0) then
         if (content(n + 1:) == checksum(content(:n))) then
            content = content(:n)
            return
         end if
      end if
      call refuse(error, folder//name//': is damaged, or was changed since it was written; run the command that wrote it again')
   end subroutine read_posterior

   !> The draws (parameter, draw) that were left in a folder, if they follow from these inputs; else none. A damaged file is refused.
   subroutine stored_draws(folder, inputs, dimension, draws, error)
      character(len=*), intent(in) :: folder, inputs
      !> How many parameters there are.
      integer, intent(in) :: dimension
      real(wp), allocatable, intent(out) :: draws(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(named_values_reader_type) :: values
      character(kind=c_char, len=:), allocatable, target :: content
      real(wp), pointer :: found(:, :)

      if (.not. file_exists(folder//name)) return
      call read_posterior(folder, content, error)
      if (allocated(error)) return
      call values%look_at(content)
      if (values%text('inputs') /= inputs) return
      found => values%columns('draws', dimension)
      draws = found
   end subroutine stored_draws
end module posterior_file
