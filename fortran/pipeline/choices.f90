!> The words that may stand in a namelist for things that vary, from the modules that own them.
module choices
   use acquisitions, only: acquisition_names
   use bases, only: basis_names
   use crystal_class, only: crystal_class_names
   use error_models, only: likelihood_names
   use indenters, only: indenter_names
   use observables, only: observable_names
   use paper_basis, only: truncation_names
   use samplers, only: sampler_names
   use specimens, only: geometry_names
   use settings_list, only: choice_list_type
   implicit none
   private
   public :: all_choices

contains

   !> A list of words for each key that `settings_schema` asks for.
   function all_choices() result(lists)
      type(choice_list_type), allocatable :: lists(:)

      allocate (lists(9))
      lists(1) = choice_list_type('geometry', geometry_names)
      lists(2) = choice_list_type('modulus_kind', observable_names)
      lists(3) = choice_list_type('likelihood', likelihood_names)
      lists(4) = choice_list_type('sampler', sampler_names)
      lists(5) = choice_list_type('basis', basis_names)
      lists(6) = choice_list_type('truncation', truncation_names)
      lists(7) = choice_list_type('acquisition', acquisition_names)
      lists(8) = choice_list_type('shape', indenter_names)
      lists(9)%key = 'symmetry'
      lists(9)%words = crystal_class_names()
   end function all_choices
end module choices
