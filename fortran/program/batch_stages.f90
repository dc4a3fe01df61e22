!> The fit of the batch program: the simulations of a campaign to a surrogate.
module batch_stages
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use build_checks, only: domain_of
   use campaign, only: campaign_name, campaign_type, row_type
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists
   use json, only: json_type
   use kinds, only: wp
   use namelist_file, only: place
   use physics_identity, only: identity_text
   use problem, only: problem_type
   use simulate, only: outcome_done
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

   !> Fit the surrogate to the simulations of the output folder that are in its domain.
   subroutine fit_simulations(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(campaign_type) :: store
      type(row_type), allocatable :: rows(:)
      type(learner_type) :: learner
      type(surrogate_type) :: surrogate
      character(len=:), allocatable :: path
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
      integer :: i, n

      path = output//'/'//campaign_name
      if (.not. file_exists(path)) then
         call raise(error, path//': the file does not exist; &crystals or the Python program make the simulations that ' &
            & //'&surrogate is fitted to', exit_bad_input)
         return
      end if
      call store%open(path, identity_text(self%settings%simulation), error)
      if (.not. allocated(error)) call store%rows(self%class%name, rows, error)
      if (.not. allocated(error)) call learner_of(self, learner, error)
      if (allocated(error)) return
      allocate (constants(self%class%n_constants, size(rows)), euler_deg(3, size(rows)), modulus(size(rows)))
      n = 0
      do i = 1, size(rows)
         if (rows(i)%outcome%status /= outcome_done) cycle
         if (.not. learner%basis%covers(self%class%stiffness(rows(i)%constants))) cycle
         n = n + 1
         constants(:, n) = rows(i)%constants
         euler_deg(:, n) = rows(i)%euler_deg
         modulus(n) = rows(i)%outcome%modulus
      end do
      if (n == 0) then
         call raise(error, path//': there is no simulation of a '//self%class%name//' crystal of this physics in &domain', &
            & exit_bad_input)
         return
      end if
      call add_simulations(learner, constants(:, :n), euler_deg(:, :n), modulus(:n), .true., error)
      if (.not. allocated(error)) call fit_learner(learner, error)
      if (.not. allocated(error)) call surrogate_of(learner, provenance_of(self), surrogate, error)
      if (allocated(error)) return
      path = output//'/'//surrogate_name(self)
      call save_surrogate(surrogate, path, error)
      told = to_text(n)//' simulations, '//to_text(surrogate%basis%n_terms)//' terms, alpha ' &
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
