!> The words that may stand in a namelist for things that vary, from the modules that own them.
module choices
   use error_models, only: likelihood_names
   use meshes, only: mesh_names
   use modulus_kinds, only: modulus_kind_names
   use samplers, only: sampler_names
   use settings_visitor, only: choice_list_type
   implicit none
   private
   public :: all_choices

contains

   !> A list of words for each key that `settings_schema` asks for.
   function all_choices() result(lists)
      type(choice_list_type), allocatable :: lists(:)

      allocate (lists(4))
      lists(1)%key = 'mesh'
      lists(1)%words = mesh_names
      lists(2)%key = 'modulus_kind'
      lists(2)%words = modulus_kind_names
      lists(3)%key = 'likelihood'
      lists(3)%words = likelihood_names
      lists(4)%key = 'sampler'
      lists(4)%words = sampler_names
   end function all_choices
end module choices
