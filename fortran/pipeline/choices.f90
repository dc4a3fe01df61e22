!> The words that may stand in a namelist for things that vary, from the modules that own them.
module choices
   use acquisitions, only: acquisition_names
   use coefficient_prior, only: prior_names
   use error_models, only: likelihood_names
   use meshes, only: mesh_names
   use modulus_kinds, only: modulus_kind_names
   use paper_basis, only: coordinate_names, truncation_names
   use samplers, only: sampler_names
   use settings_visitor, only: choice_list_type
   implicit none
   private
   public :: all_choices

contains

   !> A list of words for each key that `settings_schema` asks for.
   function all_choices() result(lists)
      type(choice_list_type), allocatable :: lists(:)

      allocate (lists(8))
      lists(1)%key = 'mesh'
      lists(1)%words = mesh_names
      lists(2)%key = 'modulus_kind'
      lists(2)%words = modulus_kind_names
      lists(3)%key = 'likelihood'
      lists(3)%words = likelihood_names
      lists(4)%key = 'sampler'
      lists(4)%words = sampler_names
      lists(5)%key = 'coordinates'
      lists(5)%words = coordinate_names
      lists(6)%key = 'truncation'
      lists(6)%words = truncation_names
      lists(7)%key = 'coefficient_prior'
      lists(7)%words = prior_names
      lists(8)%key = 'acquisition'
      lists(8)%words = acquisition_names
   end function all_choices
end module choices
