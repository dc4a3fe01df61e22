!> The bases that a surrogate may have: a new one is its module and a line in each of these procedures.
module bases
   use abstract_basis, only: basis_type
   use correction_basis, only: correction_basis_type, new_correction_basis
   use named_values, only: named_values_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use paper_basis, only: new_paper_basis, paper_basis_type
   use settings_groups, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, exchange_domain
   use theory_basis, only: theory_basis_type
   implicit none
   private
   public :: basis_names, new_basis, allocate_basis, basis_name, describe_basis

   !> Those that &surrogate may ask for.
   character(len=*), parameter :: basis_names = 'correction, paper'

contains

   !> The basis that &surrogate asks for, over a domain.
   subroutine new_basis(domain, settings, basis, error)
      type(domain_type), intent(in) :: domain
      type(surrogate_settings_type), intent(in) :: settings
      class(basis_type), allocatable, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error
      type(correction_basis_type), allocatable :: correction
      type(paper_basis_type), allocatable :: paper

      select case (settings%model)
      case ('correction')
         allocate (correction)
         call new_correction_basis(domain, settings%degree, correction, error)
         if (.not. allocated(error)) call move_alloc(correction, basis)
      case ('paper')
         allocate (paper)
         call new_paper_basis(domain, settings%truncation, settings%degree, settings%bandlimit, paper, error)
         if (.not. allocated(error)) call move_alloc(paper, basis)
      case default
         call raise(error, 'the model '''//settings%model//''' is unknown; allowed: '//basis_names, exit_bad_input)
      end select
   end subroutine new_basis

   !> A basis of this name without parameters, which `exchange` reads.
   subroutine allocate_basis(name, basis, error)
      character(len=*), intent(in) :: name
      class(basis_type), allocatable, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('correction')
         allocate (correction_basis_type :: basis)
      case ('paper')
         allocate (paper_basis_type :: basis)
      case ('halfspace')
         allocate (theory_basis_type :: basis)
      case default
         call raise(error, 'the model '''//name//''' is unknown; allowed: '//basis_names//', halfspace', exit_bad_input)
      end select
   end subroutine allocate_basis

   !> The name of a basis in files.
   pure function basis_name(basis) result(name)
      class(basis_type), intent(in) :: basis
      character(len=:), allocatable :: name

      select type (basis)
      type is (correction_basis_type)
         name = 'correction'
      type is (paper_basis_type)
         name = 'paper'
      type is (theory_basis_type)
         name = 'halfspace'
      class default
         name = ''
      end select
   end function basis_name

   !> Name the parameters of a basis, and what its terms are.
   subroutine describe_basis(basis, visitor)
      class(basis_type), intent(inout) :: basis
      type(named_values_type), intent(inout) :: visitor
      character(len=:), allocatable :: name
      integer :: directional(basis%n_terms), polynomial(basis%n_terms)
      real(wp), allocatable :: values(:)

      name = basis_name(basis)
      call visitor%text('model', name)
      call exchange_domain(basis%domain, visitor)
      call basis%exchange(visitor)
      call visitor%integer('n_terms', basis%n_terms)
      call visitor%real('least_noise', basis%least_noise)
      call visitor%put('logarithmic', basis%logarithmic)
      call basis%term_degrees(directional, polynomial)
      values = directional
      call visitor%reals('directional_degrees', values)
      values = polynomial
      call visitor%reals('polynomial_degrees', values)
   end subroutine describe_basis
end module bases
