!> The fit of the batch program: `simulations.csv` to a surrogate.
module batch_stages
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use batch_simulate, only: simulations_name
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists
   use kinds, only: degree
   use namelist_file, only: place
   use point_tables, only: points_type, read_crystals
   use problem, only: problem_type
   use surrogate_basis, only: coordinates_from_name, truncation_from_name
   use surrogate_fit, only: domain_type, fit_options_type, fit_surrogate, prior_from_name
   use surrogate_model, only: save_surrogate, surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: fits_surrogate, fit_simulations, surrogate_name

   character(len=*), parameter :: surrogate_name = 'surrogate.nml'

contains

   !> Whether the file asks for a fit; else a &surrogate is one that is there already.
   pure logical function fits_surrogate(self)
      type(problem_type), intent(in) :: self

      associate (s => self%settings)
         fits_surrogate = s%design%given .or. (s%surrogate%given .and. s%crystals%given)
      end associate
   end function fits_surrogate

   !> Fit the surrogate to `simulations.csv` of the output folder.
   subroutine fit_simulations(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(points_type) :: points
      type(domain_type) :: domain
      type(fit_options_type) :: options
      type(surrogate_type) :: surrogate
      character(len=:), allocatable :: path
      integer, allocatable :: rows(:)
      integer :: i, k

      path = output//'/'//simulations_name
      if (.not. file_exists(path)) then
         call raise(error, path//': the file does not exist; &crystals or the Python program make the simulations that ' &
            & //'&surrogate is fitted to', exit_bad_input)
         return
      end if
      call read_crystals(path, path//': ', self%class, points, error)
      if (allocated(error)) return
      rows = pack([(i, i=1, points%n)], ieee_is_finite(points%modulus_gpa))
      do i = 1, size(rows)
         if (points%class(rows(i))%name == self%class%name) cycle
         call raise(error, path//': line '//to_text(points%table%line(rows(i)))//': the crystal is not of the symmetry of ' &
            & //'&problem', exit_bad_input)
         return
      end do
      domain%class = self%class
      associate (covered => self%settings%domain, chosen => self%settings%surrogate)
         if (.not. allocated(covered%c_min)) then
            call raise(error, place(self%path, 'domain', '')//'the group is missing; the fit of &surrogate needs it', &
               & exit_bad_input)
            return
         end if
         domain%lower = covered%c_min
         domain%upper = covered%c_max
         domain%anisotropy_cap = covered%anisotropy_cap
         options%coordinates = coordinates_from_name(chosen%coordinates)
         options%truncation = truncation_from_name(chosen%truncation)
         options%prior = prior_from_name(chosen%prior)
         options%degree = chosen%degree
         options%bandlimit = chosen%bandlimit
      end associate
      k = size(domain%lower)
      call fit_surrogate(domain, options, points%constants(:k, rows), points%euler_deg(:, rows)*degree, &
         & points%modulus_gpa(rows), surrogate, error)
      if (allocated(error)) return
      path = output//'/'//surrogate_name
      call save_surrogate(surrogate, path, error)
      told = to_text(size(rows))//' simulations, '//to_text(surrogate%basis%n_terms)//' terms, alpha ' &
         & //to_text(surrogate%alpha)//', beta '//to_text(surrogate%beta)//': '//path
   end subroutine fit_simulations
end module batch_stages
