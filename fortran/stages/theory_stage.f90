!> `theory`: moduli, and speeds of surface waves, of &crystals by the exact theory of the
!> half-space, or moduli of films by that of layers.
module theory_stage
   use abstract_stage, only: stage_type
   use stage_documents, only: begin_crystal, write_moduli
   use errors, only: error_type
   use film_theory, only: film_name, film_type, indent_films
   use halfspace_theory, only: halfspace_moduli
   use json, only: json_type
   use kinds, only: wp
   use rayleigh_wave, only: rayleigh_waves, wave_speed, wave_type
   use text, only: to_text
   implicit none
   private
   public :: theory_stage_type

   type, extends(stage_type) :: theory_stage_type
   contains
      procedure :: finish
   end type theory_stage_type

contains

   !> Write theory.csv and the document.
   subroutine finish(self, page, error)
      class(theory_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: modulus(:), velocity(:)
      type(film_type), allocatable :: films(:)
      type(wave_type), allocatable :: waves(:)
      integer :: i

      associate (points => self%problem%data%crystals)
         allocate (modulus(points%n))
         if (self%problem%settings%specimen%geometry == film_name) then
            allocate (films(points%n))
            call indent_films(self%problem, points%stiffness, points%euler_deg, &
               & self%problem%threads(), films, error)
            modulus = films%modulus
         else
            call halfspace_moduli(points%stiffness, points%euler_deg, &
               & self%problem%threads(), modulus, error)
            call self%problem%locate('crystals', 'points', error)
         end if
         if (.not. allocated(error) .and. all(points%paths%is_speed()) &
            & .and. allocated(self%problem%settings%problem%density_kg_m3)) then
            allocate (waves(points%n))
            call rayleigh_waves(points%stiffness, points%euler_deg, points%paths, waves, error)
            velocity = wave_speed(waves%modulus, self%problem%settings%problem%density_kg_m3)
         end if
         if (allocated(error)) return
         ! An unallocated velocity is an absent argument.
         call write_moduli(self%problem, self%output//'/theory.csv', modulus, error, velocity)
         if (allocated(error)) return
         call page%begin_array('results')
         do i = 1, points%n
            call begin_crystal(page, points, i)
            call page%put('indentation_modulus_gpa', modulus(i))
            if (allocated(films)) then
               call page%put('relative_error', films(i)%relative_error)
               call page%put('depth_um', films(i)%depth)
               call page%put('force_mn', films(i)%force)
            end if
            if (allocated(waves)) then
               call page%put_numbers('propagation_deg, rayleigh_velocity_m_s', &
                  & [points%paths(i)%propagation_deg, velocity(i)])
               call page%put('rayleigh_detected', waves(i)%is_detected())
            end if
            call page%end_object()
         end do
         call page%end_array()
         self%done = to_text(points%n)//' crystals: '//self%output//'/theory.csv'
      end associate
   end subroutine finish
end module theory_stage
