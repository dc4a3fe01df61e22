!> Crystal classes, stiffnesses, directions, the theory of the half-space, quantities, and kinds of modulus.
module crystal_operations
   use abstract_observable, only: observable_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: anisotropy_index, averages_type, log_anisotropy, polycrystal_averages
   use distinct_directions, only: all_alike, lattice_of_directions, new_region, region_type, representative, spread_of_directions
   use errors, only: error_type, exit_bad_input, raise
   use exchange, only: exchange_type
   use halfspace_theory, only: halfspace_moduli
   use kinds, only: degree, wp
   use observables, only: new_observable
   use quantities, only: evaluate_quantities, new_quantity, quantity_type, reported_quantities
   use settings_groups, only: measurements_settings_type
   use text, only: to_text
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: perform_crystal

contains

   subroutine perform_crystal(verb, x, error)
      !> See the cases.
      character(len=*), intent(in) :: verb
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      type(region_type) :: region
      real(wp), allocatable :: found(:, :)
      real(wp), pointer :: directions(:, :)
      integer :: i

      if (x%in%has('symmetry')) call new_crystal_class(x%in%text('symmetry'), class, error)
      if (allocated(error)) return
      select case (verb)
      case ('class')
         call x%out%put('name', class%name)
         call put_names(class%constants(:class%n_constants))
      case ('stiffness')
         call give_stiffness(x, class)
      case ('averages')
         call give_averages(x)
      case ('directions')
         ! A number that are far apart over the region that the class tells apart, or of 0 an even lattice.
         call new_region(class, region)
         if (x%in%integer('count') > 0) then
            call spread_of_directions(region, int(x%in%integer('count')), found)
         else
            call lattice_of_directions(region, found)
         end if
         call x%out%put_array('directions', found, shape(found))
      case ('representatives')
         ! Of directions (3, n) the images in that region, and whether all are within `angle_deg` of one of them.
         call new_region(class, region)
         directions => x%in%columns('directions', 3)
         allocate (found, mold=directions)
         do i = 1, size(found, 2)
            found(:, i) = representative(region, directions(:, i))
         end do
         call x%out%put_array('images', found, shape(found))
         call x%out%put('alike', all_alike(region, directions, x%in%real('angle_deg')*degree))
      case ('theory')
         call give_theory(x, error)
      case ('quantities')
         call give_quantities(x, class, error)
      case ('moduli_of_kind')
         call give_kind(x, error)
      case default
         call x%refuse(verb, error)
      end select

   contains

      subroutine put_names(names)
         character(len=*), intent(in) :: names(:)
         type(warning_type), allocatable :: list(:)

         allocate (list(0))
         do i = 1, size(names)
            call warn(list, trim(names(i)))
         end do
         call x%out%put('constants', list)
      end subroutine put_names
   end subroutine perform_crystal

   !> Stiffness matrices (GPa) from constants (k, n) in GPa.
   subroutine give_stiffness(x, class)
      type(exchange_type), intent(inout) :: x
      type(crystal_class_type), intent(in) :: class
      real(wp), pointer :: constants(:, :)
      real(wp), allocatable :: stiffness(:, :, :)
      integer :: i

      constants => x%in%columns('constants', class%n_constants)
      allocate (stiffness(6, 6, size(constants, 2)))
      do i = 1, size(constants, 2)
         stiffness(:, :, i) = class%stiffness(constants(:, i))
      end do
      call x%out%put_array('stiffness', stiffness, shape(stiffness))
   end subroutine give_stiffness

   !> Of stiffnesses (GPa): anisotropy index (Eq. 14) and log-anisotropy, NaN where the crystal is not stable, and Voigt's bulk and shear
   !> modulus, then Reuss's (GPa).
   subroutine give_averages(x)
      type(exchange_type), intent(inout) :: x
      type(averages_type) :: found
      real(wp), pointer :: stiffness(:, :, :)
      real(wp), allocatable :: index(:), log_index(:), averages(:, :)
      integer :: i, n

      stiffness => x%in%matrices('stiffness')
      n = size(stiffness, 3)
      allocate (index(n), log_index(n), averages(4, n))
      do i = 1, n
         index(i) = anisotropy_index(stiffness(:, :, i))
         log_index(i) = log_anisotropy(stiffness(:, :, i))
         found = polycrystal_averages(stiffness(:, :, i))
         averages(:, i) = [found%bulk_voigt, found%shear_voigt, found%bulk_reuss, found%shear_reuss]
      end do
      call x%out%put_array('index', index, [n])
      call x%out%put_array('log_index', log_index, [n])
      call x%out%put_array('averages', averages, [4, n])
   end subroutine give_averages

   !> Indentation modulus (GPa), exact and of a circular contact, of crystals (stiffness in GPa, angles in degrees).
   subroutine give_theory(x, error)
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      real(wp), pointer :: stiffness(:, :, :)
      real(wp), allocatable :: moduli(:, :)
      integer :: n

      stiffness => x%in%matrices('stiffness')
      n = size(stiffness, 3)
      allocate (moduli(n, 2))
      call halfspace_moduli(stiffness, x%in%columns('euler_deg', 3), x%threads(), moduli(:, 1), moduli(:, 2), error)
      call x%out%put_array('modulus', moduli(:, 1), [n])
      call x%out%put_array('circular', moduli(:, 2), [n])
   end subroutine give_theory

   !> Names and units of the quantities that are reported of a class; with `constants` (k, n) in GPa the values of those `names`, one a
   !> line.
   subroutine give_quantities(x, class, error)
      type(exchange_type), intent(inout) :: x
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      type(quantity_type), allocatable :: list(:)
      type(warning_type), allocatable :: names(:), units(:)
      real(wp), pointer :: constants(:, :)
      real(wp), allocatable :: values(:, :)
      character(len=:), allocatable :: wanted
      integer :: i, length, k

      if (.not. x%in%has('names')) then
         call reported_quantities(class, list, error)
         if (allocated(error)) return
         allocate (names(0), units(0))
         do i = 1, size(list)
            call warn(names, list(i)%name)
            call warn(units, list(i)%unit)
         end do
         call x%out%put('names', names)
         call x%out%put('units', units)
         return
      end if
      k = int(x%in%integer('n_constants'))
      if (class%n_constants /= k) then
         call raise(error, 'a '//class%name//' crystal has '//to_text(class%n_constants)//' constants, not '//to_text(k), &
            & exit_bad_input)
         return
      end if
      wanted = x%in%text('names')
      allocate (list(0))
      do while (len(wanted) > 0)
         length = index(wanted//achar(10), achar(10)) - 1
         list = [list, quantity_type()]
         call new_quantity(wanted(:length), list(size(list)), error)
         if (allocated(error)) return
         wanted = wanted(min(len(wanted), length + 1) + 1:)
      end do
      constants => x%in%columns('constants', k)
      allocate (values(size(list), size(constants, 2)))
      do i = 1, size(constants, 2)
         call evaluate_quantities(list, class%stiffness(constants(:, i)), values(:, i))
      end do
      call x%out%put_array('values', values, shape(values))
   end subroutine give_quantities

   !> Indentation moduli (GPa) as another kind.
   subroutine give_kind(x, error)
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(measurements_settings_type) :: settings
      class(observable_type), allocatable :: observable
      real(wp), allocatable :: values(:), slope(:)

      settings%indenter_modulus_gpa = x%in%real('indenter_modulus_gpa')
      settings%indenter_nu = x%in%real('indenter_nu')
      settings%sample_nu = x%in%real('sample_nu')
      call new_observable(x%in%text('kind'), settings, observable, error)
      if (allocated(error)) return
      values = x%in%reals('moduli')
      slope = 0.0_wp*values + 1.0_wp
      call observable%from_simulation(values, slope)
      call x%out%put_array('values', values, shape(values))
   end subroutine give_kind
end module crystal_operations
