!> Contacts that are longer than the refined zone of the mesh.
program test_zone
   use errors, only: error_type
   use fe_indentation, only: free_indentation_model, indentation_model_type, &
      & indentation_result_type, new_indentation_model, new_wider_model, simulate_indentation
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: pi, wp
   use settings_schema, only: settings_type
   use testing, only: check, check_close, check_success, default_settings, finish, stiffness_of
   implicit none

   call test_long_contact()
   call test_wider_zone()
   call finish()

contains

   !> A long ellipse is simulated on a mesh with a wider zone, at the same depths.
   subroutine test_long_contact()
      character(len=10), parameter :: shapes(2) = [character(len=10) :: 'paraboloid', 'cone']
      type(settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: result
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      !> The theory is of a paraboloid; under a cone so long an ellipse is some 4 % stiffer, on fine
      !> meshes too.
      real(wp), parameter :: euler(3) = [270.0_wp, 80.0_wp, 0.0_wp]*pi/180.0_wp, &
         & expected(2) = [1.0_wp, 1.04_wp]
      real(wp) :: elongated(6, 6)
      integer :: i

      elongated = stiffness_of('hexagonal', [88.0_wp, 84.0_wp, 35.0_wp, 208.0_wp, 80.0_wp])
      call halfspace_modulus(elongated, euler, theory, error)
      do i = 1, size(shapes)
         settings = default_settings()
         settings%indenter%shape = trim(shapes(i))
         settings%simulation%refine = 0.75_wp
         settings%simulation%depths = 4
         call new_indentation_model(settings, model, error)
         call check_success('a model', error)
         call simulate_indentation(model, elongated, euler, result, error)
         call check_success('a long contact ellipse: '//shapes(i), error)
         if (allocated(error)) return
         call check('both solves count', result%zone > 1.0_wp &
            & .and. result%elements > 2*model%elements)
         call check('the depths are those of every crystal', &
            & maxval(abs(result%depth - model%depth)) < 1.0e-12_wp)
         call check_close('its modulus', result%modulus/theory%modulus, expected(i), 0.01_wp)
         call free_indentation_model(model)
      end do
   end subroutine test_long_contact

   !> A wider zone leaves the specimen as it is: the modulus changes by little, compared with
   !> half-spaces of 0.15 %, which is what the coarse mesh leaves. A specimen of another size would
   !> show.
   subroutine test_wider_zone()
      character(len=9), &
         & parameter :: geometries(3) = [character(len=9) :: 'halfspace', 'block', 'grain']
      type(settings_type) :: settings
      type(indentation_model_type) :: model, wider
      type(indentation_result_type) :: result(2)
      type(error_type), allocatable :: error
      real(wp) :: c(6, 6)
      integer :: i

      c = stiffness_of('cubic', [168.4_wp, 121.4_wp, 75.4_wp])
      do i = 1, size(geometries)
         settings = default_settings()
         settings%specimen%geometry = trim(geometries(i))
         settings%specimen%grain_radius_um = 2.5_wp
         settings%specimen%matrix = 'isotropic'
         settings%specimen%matrix_young_gpa = 40.0_wp
         settings%simulation%refine = 0.7_wp
         settings%simulation%depths = 4
         settings%simulation%element = 'c3d8i'
         call new_indentation_model(settings, model, error)
         call check_success('a model: '//geometries(i), error)
         call new_wider_model(model, 1.4_wp, wider, error)
         call check_success('a wider model: '//geometries(i), error)
         if (allocated(error)) return
         call simulate_indentation(model, c, [0.3_wp, 0.5_wp, 0.2_wp], result(1), error)
         call simulate_indentation(wider, c, [0.3_wp, 0.5_wp, 0.2_wp], result(2), error)
         call check_success('both simulations', error)
         call check_close('moduli with two zones: '//geometries(i), &
            & result(2)%modulus/result(1)%modulus, 1.0_wp, 2.0e-3_wp)
         call free_indentation_model(model)
         call free_indentation_model(wider)
      end do
   end subroutine test_wider_zone
end program test_zone
