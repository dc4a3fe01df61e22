!> Operations on crystals: classes, stiffnesses (GPa), directions, the theory of the half-space,
!> quantities, and kinds of modulus.
module crystal_operations
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: anisotropy_index, averages_type, log_anisotropy, &
      & polycrystal_averages
   use distinct_directions, only: lattice_of_directions, new_region, region_type, representative, &
      & spread_of_directions
   use exchange, only: exchange_type
   use halfspace_theory, only: halfspace_moduli
   use kinds, only: wp
   use observables, only: new_observable, observable_type, path_type, surface_path
   use rayleigh_wave, only: rayleigh_waves, wave_speed, wave_type
   use quantities, only: evaluate_quantities, new_quantity, quantity_type, reported_quantities
   use settings_schema, only: measurements_settings_type
   use text, only: add_line, line_type, split_list
   implicit none
   private
   public :: perform_crystal

contains

   subroutine perform_crystal(verb, x)
      !> Name of a case below.
      character(len=*), intent(in) :: verb
      type(exchange_type), intent(inout) :: x
      type(crystal_class_type) :: class
      type(region_type) :: region
      type(averages_type) :: averages
      type(line_type), allocatable :: names(:), units(:)
      type(quantity_type), allocatable :: quantities(:)
      real(wp), pointer :: columns(:, :), c(:, :, :)
      type(measurements_settings_type) :: settings
      type(observable_type) :: observable
      type(wave_type), allocatable :: waves(:)
      character(len=:), allocatable :: symmetry, wanted(:)
      integer :: i

      symmetry = ''
      if (x%in%has('symmetry')) symmetry = x%in%text('symmetry')
      ! The quantities of a stiffness without a class are those of the general class.
      if (len(symmetry) == 0 .and. verb == 'reported_quantities') symmetry = general_class
      if (x%in%has('symmetry')) call new_crystal_class(symmetry, class, x%error)
      if (allocated(x%error)) return
      if (x%in%has('stiffness')) c => x%in%matrices('stiffness')
      select case (verb)
      case ('class')
         !> symmetry -> name, constants
         call x%out%put('name', class%name)
         call x%out%put('constants', class%constants)
      case ('stiffness')
         !> symmetry, constants -> stiffness
         ! Stiffnesses of crystals with these constants (k, n).
         call x%out%put('stiffness', &
            & class%stiffnesses(x%in%columns('constants', class%n_constants)))
      case ('averages')
         !> stiffness -> values
         ! Anisotropy index (Eq. 14) and log-anisotropy, NaN if the crystal is not stable; bulk and
         ! shear modulus of Voigt, then of Reuss (GPa).
         allocate (x%values(6, size(c, 3)))
         do i = 1, size(c, 3)
            averages = polycrystal_averages(c(:, :, i))
            x%values(:, i) = [anisotropy_index(c(:, :, i)), log_anisotropy(c(:, :, i)), &
               & averages%bulk_voigt, averages%shear_voigt, averages%bulk_reuss, &
               & averages%shear_reuss]
         end do
      case ('directions')
         !> symmetry, count -> values
         ! Directions in the region of distinct directions of the class: `count` directions that
         ! are far apart, or an even lattice if `count` is 0.
         call new_region(class, region)
         if (x%in%integer('count') > 0) then
            call spread_of_directions(region, x%in%integer('count'), x%values)
         else
            call lattice_of_directions(region, x%values)
         end if
      case ('representatives')
         !> symmetry, directions -> values
         ! Equivalents of directions (3, n) in the region of distinct directions of the class.
         call new_region(class, region)
         columns => x%in%columns('directions', 3)
         allocate (x%values, mold=columns)
         do i = 1, size(columns, 2)
            x%values(:, i) = representative(region, columns(:, i))
         end do
      case ('theory')
         !> stiffness, euler_deg, threads -> values
         ! Indentation moduli (GPa) of crystals at angles (degrees): the exact ones, then those for
         ! a circular contact.
         allocate (x%values(size(c, 3), 2))
         call halfspace_moduli(c, x%in%columns('euler_deg', 3), x%threads(), x%values(:, 1), &
            & x%error, x%values(:, 2))
      case ('waves')
         !> stiffness, euler_deg, propagation_deg, density_kg_m3 -> values
         ! Speeds of the surface wave and of the slowest bulk wave (m/s), and the part of the
         ! displacement normal to the surface. Each crystal has its angles (degrees), its direction
         ! of propagation (degrees) and its density (kg/m3).
         columns => x%in%columns('propagation_deg', 1)
         allocate (waves(size(c, 3)))
         call rayleigh_waves(c, x%in%columns('euler_deg', 3), &
            & [(path_type(surface_path, columns(1, i)), i=1, size(c, 3))], waves, x%error)
         if (allocated(x%error)) return
         columns => x%in%columns('density_kg_m3', 1)
         x%values = reshape([wave_speed(waves%modulus, columns(1, :)), &
            & wave_speed(waves%bulk, columns(1, :)), waves%normal_share], [size(waves), 3])
      case ('reported_quantities')
         !> symmetry -> names, units
         call reported_quantities(class, quantities, x%error)
         if (allocated(x%error)) return
         do i = 1, size(quantities)
            call add_line(names, quantities(i)%name)
            call add_line(units, quantities(i)%unit)
         end do
         call x%out%put('names', names)
         call x%out%put('units', units)
      case ('quantities')
         !> names, stiffness -> values
         wanted = split_list(x%in%text('names'))
         allocate (quantities(size(wanted)), x%values(size(wanted), size(c, 3)))
         do i = 1, size(wanted)
            call new_quantity(trim(wanted(i)), quantities(i), x%error)
            if (allocated(x%error)) return
         end do
         do i = 1, size(c, 3)
            call evaluate_quantities(quantities, c(:, :, i), x%values(:, i))
         end do
      case ('moduli_of_kind')
         !> kind, moduli, indenter_modulus_gpa, indenter_nu, sample_nu -> values
         ! Convert indentation moduli (GPa) to another kind.
         settings%indenter_modulus_gpa = x%in%real('indenter_modulus_gpa')
         settings%indenter_nu = x%in%real('indenter_nu')
         settings%sample_nu = x%in%real('sample_nu')
         call new_observable(x%in%text('kind'), settings, observable, x%error)
         if (allocated(x%error)) return
         x%values = x%in%columns('moduli', 1)
         call observable%to_measured(x%values(1, :))
      case default
         call x%refuse(verb)
      end select
   end subroutine perform_crystal
end module crystal_operations
