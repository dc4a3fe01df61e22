!> The bases that a surrogate may have: a new one is its module and a line in `allocate_basis`.
module bases
   use abstract_basis, only: basis_type
   use correction_basis, only: correction_basis_type
   use errors, only: error_type, refuse
   use labelled_values, only: labelled_values_type
   use named_values, only: named_values_type
   use paper_basis, only: paper_basis_type
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, exchange_domain
   implicit none
   private
   public :: basis_names, new_basis, allocate_basis, describe_basis

   !> Those that &surrogate may ask for.
   character(len=*), parameter :: basis_names = 'correction, paper'

contains

   !> The basis that &surrogate asks for, over a domain.
   subroutine new_basis(domain, settings, basis, error)
      type(domain_type), intent(in) :: domain
      type(surrogate_settings_type), intent(in) :: settings
      class(basis_type), allocatable, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      call allocate_basis(settings%model, basis, error)
      if (allocated(error)) return
      basis%domain = domain
      basis%settings = settings
      call basis%set_up(error)
   end subroutine new_basis

   !> A basis of this model, to be set up when its domain and its settings are known.
   subroutine allocate_basis(model, basis, error)
      character(len=*), intent(in) :: model
      class(basis_type), allocatable, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      select case (model)
      case ('correction', 'halfspace')
         allocate (correction_basis_type :: basis)
      case ('paper')
         allocate (paper_basis_type :: basis)
      case default
         call refuse(error, 'the model '''//model//''' is unknown; allowed: '//basis_names &
            & //', halfspace')
         return
      end select
      basis%settings%model = model
   end subroutine allocate_basis

   !> Name the parameters of a basis, and what its terms are.
   subroutine describe_basis(basis, found)
      class(basis_type), intent(inout) :: basis
      type(named_values_type), intent(inout), target :: found
      type(labelled_values_type) :: labels

      labels%described => found
      call exchange_domain(basis%domain, labels)
      call basis%exchange(labels)
      call found%put('model', basis%settings%model)
      call found%put('n_terms', basis%n_terms)
      call found%put('least_noise', basis%least_noise)
      call found%put('noise_growth', basis%noise_growth)
      call found%put('logarithmic', basis%logarithmic)
      if (allocated(basis%prior_degrees)) then
         call found%put_integers('polynomial_degrees', basis%prior_degrees, [basis%n_terms])
      end if
   end subroutine describe_basis
end module bases
