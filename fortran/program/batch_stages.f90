!> The fit of the batch program: `simulations.csv` to a surrogate.
module batch_stages
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use build_checks, only: domain_of
   use batch_simulate, only: simulations_name
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists
   use json, only: json_type
   use namelist_file, only: place
   use point_tables, only: points_type, read_crystals
   use problem, only: problem_type
   use surrogate_domain, only: domain_type
   use surrogate_file, only: check_replaceable, save_surrogate
   use surrogate_learner, only: add_simulations, fit_learner, learner_type, new_learner, surrogate_of
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: fits_surrogate, check_fit, fit_simulations, surrogate_name

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
      type(learner_type) :: learner
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
      call learner_of(self, learner, error)
      if (allocated(error)) return
      k = self%class%n_constants
      call add_simulations(learner, points%constants(:k, rows), points%euler_deg(:, rows), points%modulus_gpa(rows), .true., error)
      if (.not. allocated(error)) call fit_learner(learner, error)
      if (.not. allocated(error)) call surrogate_of(learner, provenance_of(self), surrogate, error)
      if (allocated(error)) return
      path = output//'/'//surrogate_name(self)
      call save_surrogate(surrogate, path, error)
      told = to_text(size(rows))//' simulations, '//to_text(surrogate%basis%n_terms)//' terms, alpha ' &
         & //to_text(surrogate%alpha)//', beta '//to_text(surrogate%beta)//': '//path
   end subroutine fit_simulations

   !> Refuse a fit whose surrogate could not be kept.
   subroutine check_fit(self, output, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(error_type), allocatable, intent(out) :: error

      call check_replaceable(output//'/'//self%settings%surrogate%file, error)
      if (allocated(error)) error%message = place(self%path, 'surrogate', 'file')//error%message
   end subroutine check_fit

   !> The learner that &domain and &surrogate ask for, without simulations.
   subroutine learner_of(self, learner, error)
      type(problem_type), intent(in) :: self
      type(learner_type), intent(out) :: learner
      type(error_type), allocatable, intent(out) :: error
      type(domain_type) :: domain
      class(basis_type), allocatable :: basis

      call domain_of(self, domain, error)
      if (.not. allocated(error)) call new_basis(domain, self%settings%surrogate, basis, error)
      if (.not. allocated(error)) call new_learner(basis, self%settings%surrogate%prior, learner, error)
   end subroutine learner_of

   !> Where the surrogate comes from, as JSON.
   function provenance_of(self) result(text)
      type(problem_type), intent(in) :: self
      character(len=:), allocatable :: text
      type(json_type) :: document

      call document%begin_object()
      call document%put('title', 'surrogate of the indentation modulus of '//self%class%name//' crystals')
      call document%put('namelist', self%resolved_text())
      call document%end_object()
      text = document%text()
   end function provenance_of

   !> The name of the surrogate in the output folder.
   function surrogate_name(self) result(name)
      type(problem_type), intent(in) :: self
      character(len=:), allocatable :: name

      name = self%settings%surrogate%file
   end function surrogate_name
end module batch_stages
