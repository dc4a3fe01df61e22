!> Indentation moduli of films by theory, read from forces and stiffnesses as &specimen estimator
!> says.
module film_theory
   use basic_specimen, only: fineness, require
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: check_stiffness, isotropic_stiffness, rotate_stiffness, &
      & rotation_matrix
   use errors, only: error_type, locate_error, prefix_error, refuse
   use fe_indentation, only: least_elements
   use indenters, only: indenter_type, new_indenter
   use kinds, only: degree, wp
   use layered_compliance, only: layers_type
   use layered_contact, only: contact_type, indent_layers
   use problem, only: problem_type
   use settings_schema, only: specimen_settings_type
   use text, only: join, to_text
   implicit none
   private
   public :: film_name, film_type, check_film, indent_films, young_of_film

   character(len=*), parameter :: film_name = 'film'

   !> Modulus of a film, GPa, with an estimate of its relative error, and the curve, um and mN.
   type :: film_type
      real(wp) :: modulus = 0.0_wp, relative_error = 0.0_wp
      real(wp), allocatable :: depth(:), force(:)
   end type film_type

   !> The film of a problem and its indenter.
   type :: specimen_type
      class(indenter_type), allocatable :: indenter
      !> The stiffness of the crystal is 0.
      type(layers_type) :: layers
      !> Number of the layer that is the crystal; the last is the half-space.
      integer :: crystal = 1
      character(len=:), allocatable :: estimator
      integer :: depths = 0
   end type specimen_type

   !> Largest relative error of a modulus.
   real(wp), parameter :: accuracy = 1.0e-5_wp

contains

   !> Refuse a film whose variables are missing or contradict each other.
   subroutine check_film(problem, error)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(out) :: error
      type(specimen_type) :: specimen

      call new_specimen(problem, specimen, error)
   end subroutine check_film

   !> Indent crystals as films, on `threads` threads. The error is that of the first crystal that
   !> has one; the modulus of a crystal with an error is 0.
   subroutine indent_films(problem, stiffness, euler_deg, threads, films, error)
      type(problem_type), intent(in) :: problem
      !> GPa, (6, 6, n); Bunge-Euler angles in degrees, (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler_deg(:, :)
      integer, intent(in) :: threads
      type(film_type), intent(out) :: films(:)
      type(error_type), allocatable, intent(out) :: error
      type(specimen_type) :: specimen
      type(error_type), allocatable :: own_error
      logical :: failed(size(films))
      integer :: i

      call new_specimen(problem, specimen, error)
      if (allocated(error)) return
      !$omp parallel do num_threads(threads) schedule(dynamic) private(own_error)
      do i = 1, size(films)
         call indent_film(specimen, stiffness(:, :, i), degree*euler_deg(:, i), films(i), own_error)
         failed(i) = allocated(own_error)
      end do
      !$omp end parallel do
      i = findloc(failed, .true., dim=1)
      if (i == 0) return
      call indent_film(specimen, stiffness(:, :, i), degree*euler_deg(:, i), films(i), error)
      call prefix_error(error, 'crystal '//to_text(i)//': ')
      call problem%locate('', '', error)
   end subroutine indent_films

   !> Young's modulus, GPa, of an isotropic crystal whose film has this modulus, about; that of a
   !> half-space where no film has it.
   real(wp) function young_of_film(problem, modulus, nu) result(young)
      type(problem_type), intent(in) :: problem
      !> GPa, and Poisson's ratio.
      real(wp), intent(in) :: modulus, nu
      !> Tolerance and longest step in the logarithm; least slope of the logarithm of a film's
      !> modulus by that of its crystal's.
      real(wp), parameter :: tolerance = 0.01_wp, longest = 1.5_wp, least_slope = 0.1_wp
      integer, parameter :: most_steps = 20
      type(specimen_type) :: specimen
      type(film_type) :: found
      type(error_type), allocatable :: error
      real(wp) :: slope, step, misfit, before
      integer :: i

      young = (1.0_wp - nu**2)*modulus
      call new_specimen(problem, specimen, error)
      if (allocated(error)) return
      slope = 1.0_wp
      step = 0.0_wp
      do i = 1, most_steps
         call indent_film(specimen, isotropic_stiffness(young, nu), spread(0.0_wp, 1, 3), found, &
            & error)
         if (allocated(error)) return
         misfit = log(modulus/found%modulus)
         if (abs(step) > 0.0_wp) slope = max(least_slope, (before - misfit)/step)
         if (abs(misfit) < tolerance*slope) return
         step = max(-longest, min(longest, misfit/slope))
         before = misfit
         young = young*exp(step)
      end do
   end function young_of_film

   !> Indent a crystal as a film.
   subroutine indent_film(specimen, stiffness, euler, found, error)
      type(specimen_type), intent(in) :: specimen
      !> In crystal axes, GPa, (6, 6); Bunge-Euler angles in radians, (3).
      real(wp), intent(in) :: stiffness(:, :), euler(:)
      type(film_type), intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(layers_type) :: film
      type(contact_type) :: contacts(specimen%depths)
      !> Contact radii on a half-space at the depths, um.
      real(wp), dimension(specimen%depths) :: radii, unit_force
      integer :: quantity, n, i

      call check_stiffness(stiffness, error)
      if (allocated(error)) return
      film = specimen%layers
      film%c(:, :, specimen%crystal) = rotate_stiffness(stiffness, rotation_matrix(euler))
      n = specimen%depths
      radii = [(specimen%indenter%contact_radius*i/n, i=1, n)]
      quantity = 1
      if (specimen%estimator == 'stiffness_hertz') quantity = 2
      if (specimen%estimator == 'stiffness') quantity = 3
      call indent_layers(film, specimen%indenter, radii, quantity, accuracy, contacts, error)
      found%depth = contacts%depth
      found%force = contacts%force
      if (allocated(error)) return
      found%relative_error = contacts(n)%error(quantity)
      select case (quantity)
      case (1)
         ! The depths of which a simulation takes the modulus.
         unit_force = specimen%indenter%unit_force(contacts%depth)
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
   end subroutine indent_film

   !> The film of a problem. An error has the file, the group and the variable.
   subroutine new_specimen(problem, specimen, error)
      type(problem_type), intent(in) :: problem
      type(specimen_type), intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: names(6) = [character(len=20) :: 'substrate_young_gpa', &
         & 'substrate_symmetry', 'substrate_constants', 'substrate_euler_deg', 'thickness_um', &
         & 'substrate']
      logical :: is_stated(size(names))
      integer :: i

      specimen%depths = problem%settings%simulation%depths
      specimen%estimator = problem%settings%specimen%estimator
      call new_indenter(problem%settings%indenter, specimen%indenter, error)
      call locate_error(error, '', 'indenter')
      if (.not. allocated(error)) then
         associate (stated => problem%settings%specimen, film => specimen%layers)
            is_stated(:3) = [allocated(stated%substrate_young_gpa), &
               & allocated(stated%substrate_symmetry), allocated(stated%substrate_constants)]
            is_stated(4:) = [allocated(stated%substrate_euler_deg), &
               & allocated(stated%thickness_um), stated%substrate == 'rigid']
            ! A file of layers has all of them; a rigid substrate has no stiffness.
            i = findloc(is_stated .and. allocated(problem%data%layers), .true., 1)
            if (i == 0 .and. is_stated(6)) i = findloc(is_stated(:4), .true., 1)
            if (i > 0) then
               call refuse(error, 'contradicts '//trim(merge('layers   ', 'substrate', &
                  & allocated(problem%data%layers)))//'; remove one of them', &
                  & variable=trim(names(i)))
            else if (allocated(problem%data%layers)) then
               film%thickness = problem%data%layers%thickness
               film%c = problem%data%layers%stiffness
               specimen%crystal = problem%data%layers%crystal
            else
               allocate (film%thickness(1), film%c(6, 6, merge(1, 2, stated%substrate == 'rigid')))
               film%c = 0.0_wp
               call require(film_name, 'thickness_um', stated%thickness_um, film%thickness(1), &
                  & error)
               if (size(film%c, 3) > 1 .and. .not. allocated(error)) then
                  call find_substrate(stated, film%c(:, :, 2))
               end if
            end if
         end associate
         call locate_error(error, '', 'specimen')
      end if
      call problem%locate('', '', error)

   contains

      !> Stiffness of the substrate in sample axes, GPa.
      subroutine find_substrate(stated, stiffness)
         type(specimen_settings_type), intent(in) :: stated
         real(wp), intent(out) :: stiffness(6, 6)
         type(crystal_class_type) :: class
         real(wp) :: young

         stiffness = 0.0_wp
         if (.not. allocated(stated%substrate_symmetry)) then
            if (allocated(stated%substrate_constants) &
               & .or. allocated(stated%substrate_euler_deg)) then
               call refuse(error, 'the variable is missing; a substrate of a crystal needs it', &
                  & variable='substrate_symmetry')
               return
            end if
            call require(film_name, 'substrate_young_gpa', stated%substrate_young_gpa, young, error)
            if (.not. allocated(error)) stiffness = isotropic_stiffness(young, stated%substrate_nu)
            return
         end if
         call new_crystal_class(stated%substrate_symmetry, class, error)
         call locate_error(error, '', variable='substrate_symmetry')
         if (allocated(error)) return
         if (allocated(stated%substrate_young_gpa)) then
            call refuse(error, 'is for an isotropic substrate; remove it, or substrate_symmetry', &
               & variable='substrate_young_gpa')
         else if (.not. allocated(stated%substrate_constants)) then
            call refuse(error, 'the variable is missing; substrate_symmetry needs it', &
               & variable='substrate_constants')
         else if (size(stated%substrate_constants) /= size(class%constants)) then
            call refuse(error, to_text(size(stated%substrate_constants))//' values; ' &
               & //to_text(class%n_constants)//' are needed: '//join(class%constants, ', '), &
               & variable='substrate_constants')
         else
            stiffness = class%stiffness(stated%substrate_constants)
            call check_stiffness(stiffness, error)
            call locate_error(error, '', variable='substrate_constants')
         end if
         if (allocated(error) .or. .not. allocated(stated%substrate_euler_deg)) return
         if (size(stated%substrate_euler_deg) /= 3) then
            call refuse(error, to_text(size(stated%substrate_euler_deg))//' values; 3 are ' &
               & //'needed: phi1, Phi, phi2', variable='substrate_euler_deg')
            return
         end if
         stiffness = rotate_stiffness(stiffness, rotation_matrix(degree*stated%substrate_euler_deg))
      end subroutine find_substrate
   end subroutine new_specimen

end module film_theory
