!> What a measurement observes: a kind of modulus of an indentation, or the speed of a wave. A kind
!> of modulus converts the modulus of the half-space, between the grain model and the likelihood.
module observables
   use errors, only: error_type, refuse
   use kinds, only: wp
   use settings_schema, only: measurements_settings_type
   use text, only: join, to_text
   implicit none
   private
   public :: observable_type, modulus_kinds, new_observable
   public :: path_type, path_names, surface_path, longitudinal_path

   !> Kinds of modulus of an indentation; the column of a kind is named 'KIND_gpa'. A new one needs
   !> its name here and a case in `new_observable`.
   character(len=*), parameter :: modulus_kinds(3) = [character(len=19) :: 'indentation_modulus', &
      & 'effective_modulus', 'sample_modulus']

   !> A kind of modulus as a function of the modulus M of the half-space: a M/(1 + d M).
   !>
   !> M itself; E_eff of the contact with an elastic indenter, 1/E_eff = 1/M + (1-nu_i²)/E_i; E_s =
   !> (1-nu_s²) M of a sample whose Poisson's ratio is assumed.
   type :: observable_type
      !> Value of `modulus_kind`; with the unit also the name of a column.
      character(len=:), allocatable :: name
      !> a, and d, 1/GPa.
      real(wp) :: factor = 1.0_wp, compliance = 0.0_wp
   contains
      procedure :: to_measured
   end type observable_type

   !> Kinds of waves by number: the surface wave, then the bulk waves.
   character(len=*), parameter :: path_names(4) = [character(len=12) :: 'rayleigh', &
      & 'longitudinal', 'shear_slow', 'shear_fast']
   integer, parameter :: indentation = 0, surface_path = 1, longitudinal_path = 2

   !> Kind and direction of the wave whose speed is measured; by default an indentation, without a
   !> wave.
   type :: path_type
      integer :: kind = indentation
      !> Direction in the surface, from x towards y, and inclination towards the normal; degrees.
      real(wp) :: propagation_deg = 0.0_wp, inclination_deg = 0.0_wp
   contains
      procedure :: is_speed
   end type path_type

contains

   !> Whether the measurement is the speed of a wave.
   pure elemental logical function is_speed(self)
      class(path_type), intent(in) :: self

      is_speed = self%kind /= indentation
   end function is_speed

   !> The observable called `name`, with the properties that &measurements states.
   subroutine new_observable(name, settings, observable, error)
      character(len=*), intent(in) :: name
      type(measurements_settings_type), intent(in) :: settings
      type(observable_type), intent(out) :: observable
      type(error_type), allocatable, intent(out) :: error

      observable%name = name
      associate (young => settings%indenter_modulus_gpa, nu => settings%indenter_nu, &
         & sample_nu => settings%sample_nu)
         if (.not. (young > 0.0_wp .and. abs(nu) < 1.0_wp .and. abs(sample_nu) < 1.0_wp)) then
            call refuse(error, 'the indenter''s modulus ('//to_text(young) &
               & //' GPa) must be positive, Poisson''s ratios ('//to_text(nu)//', ' &
               & //to_text(sample_nu)//') within -1 .. 1')
         end if
         if (allocated(error)) return
         select case (name)
         case ('indentation_modulus')
         case ('effective_modulus')
            observable%compliance = (1.0_wp - nu**2)/young
         case ('sample_modulus')
            observable%factor = 1.0_wp - sample_nu**2
         case default
            call refuse(error, 'modulus_kind: '''//name//''' is unknown; allowed: ' &
               & //join(modulus_kinds, ', '))
         end select
      end associate
   end subroutine new_observable

   !> Convert indentation moduli to the observable, in place.
   pure subroutine to_measured(self, values, slopes)
      class(observable_type), intent(in) :: self
      !> Indentation moduli, GPa.
      real(wp), intent(inout) :: values(:)
      !> Their derivatives with respect to any variable.
      real(wp), intent(inout), optional :: slopes(:)

      if (present(slopes)) slopes = slopes*self%factor/(1.0_wp + self%compliance*values)**2
      if (self%compliance > 0.0_wp) values = values/(1.0_wp + self%compliance*values)
      values = values*self%factor
   end subroutine to_measured

end module observables
