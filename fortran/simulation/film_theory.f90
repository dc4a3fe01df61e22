!> Indentation moduli of films by theory, read from forces and stiffnesses as &specimen estimator
!> says.
module film_theory
   use basic_specimen, only: fineness, require
   use crystal_elasticity, only: check_stiffness, isotropic_stiffness, rotate_stiffness, &
      & rotation_matrix
   use errors, only: error_type, locate_error
   use fe_indentation, only: least_elements
   use indenters, only: indenter_type, new_indenter
   use kinds, only: degree, wp
   use layered_compliance, only: layers_type
   use layered_contact, only: contact_type, indent_layers
   use settings_schema, only: settings_type
   use text, only: to_text
   implicit none
   private
   public :: film_type, indent_film, indent_films

   !> Modulus of a film, GPa, with an estimate of its relative error, and the curve, um and mN.
   type :: film_type
      real(wp) :: modulus = 0.0_wp, relative_error = 0.0_wp
      real(wp), allocatable :: depth(:), force(:)
   end type film_type

   !> Largest relative error of a modulus.
   real(wp), parameter :: accuracy = 1.0e-5_wp

contains

   !> Indent crystals as films, on `threads` threads. The error is that of the first crystal that
   !> has one.
   subroutine indent_films(settings, stiffness, euler_deg, threads, films, error)
      type(settings_type), intent(in) :: settings
      !> GPa, (6, 6, n); Bunge-Euler angles in degrees, (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler_deg(:, :)
      integer, intent(in) :: threads
      type(film_type), intent(out) :: films(:)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: own_error, errors(:)
      integer :: i

      allocate (errors(size(films)))
      !$omp parallel do num_threads(threads) schedule(dynamic) private(own_error)
      do i = 1, size(films)
         errors(i)%message = ''
         call indent_film(settings, stiffness(:, :, i), degree*euler_deg(:, i), films(i), own_error)
         if (allocated(own_error)) errors(i) = own_error
      end do
      !$omp end parallel do
      do i = 1, size(films)
         if (len(errors(i)%message) == 0) cycle
         allocate (error, source=errors(i))
         ! An error of the settings has a group.
         if (error%group == '') error%message = 'crystal '//to_text(i)//': '//error%message
         return
      end do
   end subroutine indent_films

   !> Indent a crystal as a film.
   subroutine indent_film(settings, stiffness, euler, found, error)
      type(settings_type), intent(in) :: settings
      !> In crystal axes, GPa, (6, 6); Bunge-Euler angles in radians, (3).
      real(wp), intent(in) :: stiffness(:, :), euler(:)
      type(film_type), intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      class(indenter_type), allocatable :: indenter
      type(layers_type) :: film
      type(contact_type) :: contacts(settings%simulation%depths)
      integer :: i

      call new_indenter(settings%indenter, indenter, error)
      call locate_error(error, '', 'indenter')
      if (.not. allocated(error)) call new_film(settings, film, error)
      if (.not. allocated(error)) call check_stiffness(stiffness, error)
      if (allocated(error)) return
      film%c(:, :, 1) = rotate_stiffness(stiffness, rotation_matrix(euler))
      call film_modulus(film, indenter, indenter%contact_radius*[(real(i, wp)/size(contacts), i=1, &
         & size(contacts))], settings%specimen%estimator, contacts, found, error)
      found%depth = contacts%depth
      found%force = contacts%force
   end subroutine indent_film

   !> The film of the settings, without a crystal.
   subroutine new_film(settings, film, error)
      type(settings_type), intent(in) :: settings
      type(layers_type), intent(out) :: film
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: young

      associate (stated => settings%specimen)
         allocate (film%thickness(1), film%c(6, 6, merge(1, 2, stated%substrate == 'rigid')))
         film%c = 0.0_wp
         call require('film', 'thickness_um', stated%thickness_um, film%thickness(1), error)
         if (stated%substrate /= 'rigid') then
            call require('film', 'substrate_young_gpa', stated%substrate_young_gpa, young, error)
            if (.not. allocated(error)) then
               film%c(:, :, 2) = isotropic_stiffness(young, stated%substrate_nu)
            end if
         end if
         call locate_error(error, '', 'specimen')
      end associate
   end subroutine new_film

   !> Modulus of a film, GPa.
   subroutine film_modulus(film, indenter, radii, estimator, contacts, found, error)
      type(layers_type), intent(in) :: film
      class(indenter_type), intent(in) :: indenter
      !> Contact radii on a half-space at the depths, um.
      real(wp), intent(in) :: radii(:)
      character(len=*), intent(in) :: estimator
      type(contact_type), intent(out) :: contacts(:)
      type(film_type), intent(inout) :: found
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: unit_force(size(radii))
      integer :: quantity, n

      n = size(radii)
      quantity = 1
      if (estimator == 'stiffness_hertz') quantity = 2
      if (estimator == 'stiffness') quantity = 3
      call indent_layers(film, indenter, radii, quantity, accuracy, contacts, error)
      if (allocated(error)) return
      found%relative_error = contacts(n)%error(quantity)
      select case (quantity)
      case (1)
         ! The depths of which a simulation takes the modulus.
         unit_force = indenter%unit_force(contacts%depth)
         associate (resolved => radii*fineness >= least_elements*radii(n)*(1.0_wp - 1.0e-9_wp))
            found%modulus = sum(contacts%force*unit_force, mask=resolved) &
               & /sum(unit_force**2, mask=resolved)
            found%relative_error = maxval(contacts%error(1), mask=resolved)
         end associate
      case (2)
         found%modulus = contacts(n)%stiffness/(2.0_wp*radii(n))
      case default
         found%modulus = contacts(n)%stiffness/(2.0_wp*contacts(n)%radius)
      end select
   end subroutine film_modulus
end module film_theory
