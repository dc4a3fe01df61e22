!> The bases of surrogates. A new one needs a module, a case in `allocate_basis` and its settings in
!> `exchange_settings`.
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
   public :: basis_names, new_basis, allocate_basis, exchange_settings, describe_basis

   !> Names that &surrogate may state.
   character(len=*), parameter :: basis_names = 'correction, paper'

contains

   !> The basis that &surrogate states, over a domain.
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

   !> Allocate a basis of this model. It can be set up once its domain and its settings are known.
   subroutine allocate_basis(model, basis, error)
      character(len=*), intent(in) :: model
      class(basis_type), allocatable, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      select case (model)
      case ('correction', 'film', 'halfspace')
         allocate (correction_basis_type :: basis)
      case ('paper')
         allocate (paper_basis_type :: basis)
      case default
         call refuse(error, 'the model '''//model//''' is unknown; allowed: '//basis_names &
            & //', film, halfspace')
         return
      end select
      basis%settings%model = model
   end subroutine allocate_basis

   !> Write or read the settings that the model has.
   subroutine exchange_settings(settings, file)
      type(surrogate_settings_type), intent(inout) :: settings
      type(labelled_values_type), intent(inout) :: file

      ! The file has the derivatives that were used, and no others.
      if (file%reading) settings%derivatives = .true.
      if (settings%model == 'paper') call file%text('truncation', settings%truncation)
      if (settings%model /= 'halfspace') call file%integer('degree', settings%degree)
      if (settings%model /= 'paper') return
      call file%integer('bandlimit', settings%bandlimit)
      call file%option('prior_sd', settings%prior_sd, 'equal')
   end subroutine exchange_settings

   !> Store the parameters of a basis and its terms as named values.
   subroutine describe_basis(basis, description)
      class(basis_type), intent(inout) :: basis
      type(named_values_type), intent(inout), target :: description
      type(labelled_values_type) :: labels

      labels%described => description
      call exchange_domain(basis%domain, labels)
      call exchange_settings(basis%settings, labels)
      call description%put('model', basis%settings%model)
      call description%put('n_terms', basis%n_terms)
      call description%put('least_noise', basis%least_noise)
      call description%put('noise_growth', basis%noise_growth)
      call description%put('logarithmic', basis%logarithmic)
      if (allocated(basis%prior_degrees)) then
         call description%put_integers('polynomial_degrees', basis%prior_degrees, [basis%n_terms])
      end if
   end subroutine describe_basis
end module bases
