!> Refusals and warnings of a build that need no simulation; the domain and the basis of a problem;
!> and the truncations that &surrogate `scan` compares. The scan '1, 2, 3 x 8, 10, 12' stands for
!> each of these degrees with each of these bandlimits.
module build_checks
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use crystal_class, only: general_class
   use errors, only: error_type, exit_bad_input, refuse
   use files, only: printable
   use kinds, only: wp
   use machine, only: check_memory
   use problem, only: problem_type
   use settings_schema, only: surrogate_settings_type
   use simulate, only: specimen_stiffness
   use surrogate_domain, only: complete_domain, domain_type
   use surrogate_model, only: check_new_name, check_replaceable
   use text, only: join, number_ok, read_integer, split_list, to_text
   implicit none
   private
   public :: check_build, question_candidates, basis_of_problem, read_scan

   !> Default range of the scale of the crystals: they are up to 3 times stiffer, or more compliant,
   !> than the other parts of the specimen.
   real(wp), parameter :: scale_factor = 3.0_wp

contains

   !> Refuse a name of a file that is not allowed for a surrogate, an impossible basis, a build that
   !> needs more memory than there is, and impossible truncations.
   subroutine check_build(problem, error, output)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(out) :: error
      !> Folder, without a slash at its end, in which the file of the surrogate must be replaceable.
      character(len=*), intent(in), optional :: output
      class(basis_type), allocatable :: basis
      !> Of a number.
      real(wp), parameter :: bytes = 8.0_wp
      integer :: n

      call check_new_name(problem%settings%surrogate%file, error)
      if (present(output) .and. .not. allocated(error)) then
         call check_replaceable(output//'/'//problem%settings%surrogate%file, error)
      end if
      call problem%locate('surrogate', 'file', error)
      if (allocated(error)) return
      call basis_of_problem(problem, basis, error)
      if (allocated(error)) return
      if (.not. allocated(basis%prior_degrees) &
         & .and. problem%settings%design%budget < basis%n_terms) then
         call problem%refuse('design', 'budget', to_text(problem%settings%design%budget) &
            & //' simulations are fewer than the '//to_text(basis%n_terms) &
            & //' terms of the surrogate; allowed: '//to_text(basis%n_terms) &
            & //' or more, a lower degree or bandlimit, or model = ''correction''', error)
         return
      end if
      n = problem%settings%design%n_candidates
      if (allocated(problem%data%candidates)) n = problem%data%candidates%n
      ! Two copies of the terms of all candidates, while they are whitened, and four square matrices
      ! of the terms.
      call check_memory(bytes*basis%n_terms*(2.0_wp*n + 4.0_wp*basis%n_terms), &
         & to_text(n)//' candidates of '//to_text(basis%n_terms)//' terms', error)
      call problem%locate('design', 'n_candidates', error)
      if (allocated(error)) then
         error%status = exit_bad_input
      else
         call check_scan()
      end if

   contains

      !> Refuse impossible truncations of `scan`.
      subroutine check_scan()
         type(surrogate_settings_type) :: settings
         class(basis_type), allocatable :: truncated
         integer, allocatable :: pairs(:, :)
         integer :: i

         settings = problem%settings%surrogate
         call read_scan(settings%scan, pairs, error)
         if (.not. allocated(error) .and. size(pairs) > 0 .and. settings%model /= 'paper') then
            call refuse(error, &
               & 'the '//settings%model//' has no bandlimit; allowed with model = ''paper''')
         end if
         do i = 1, size(pairs, 2)
            if (allocated(error)) exit
            settings%degree = pairs(1, i)
            settings%bandlimit = pairs(2, i)
            call new_basis(basis%domain, settings, truncated, error)
         end do
         call problem%locate('surrogate', 'scan', error)
      end subroutine check_scan
   end subroutine check_build

   !> Warn of candidates outside the domain of the surrogate.
   subroutine question_candidates(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(domain_type) :: domain
      integer :: i, outside

      call domain_of(self, domain, error)
      if (allocated(error)) return
      outside = count([(.not. domain%admits(self%data%candidates%stiffness(:, :, i)), i=1, &
         & self%data%candidates%n)])
      if (outside > 0) then
         call self%warn('candidates_left_out', &
            & 'the table '//printable(self%settings%design%candidates), &
            & [real(wp) :: outside, self%data%candidates%n])
      end if
   end subroutine question_candidates

   !> The basis that &domain and &surrogate define.
   subroutine basis_of_problem(self, basis, error)
      type(problem_type), intent(in) :: self
      class(basis_type), allocatable, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error
      type(domain_type) :: domain

      call domain_of(self, domain, error)
      if (allocated(error)) return
      call new_basis(domain, self%settings%surrogate, basis, error)
      call self%locate('surrogate', '', error)
   end subroutine basis_of_problem

   !> The domain of validity of the surrogate of a problem: crystals of its class between bounds of
   !> the constants, or crystals of all classes within limits of invariants.
   subroutine domain_of(self, domain, error)
      type(problem_type), intent(in) :: self
      type(domain_type), intent(out) :: domain
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: class

      call set_range_of_scale()
      if (allocated(error)) return
      associate (stated => self%settings%domain)
         if (allocated(stated%c_min) .and. allocated(stated%c_max)) then
            class = self%class%name
            domain%lower = stated%c_min
            domain%upper = stated%c_max
            if (allocated(stated%anisotropy_cap)) domain%anisotropy_cap = stated%anisotropy_cap
         else if (allocated(stated%c_min) .or. allocated(stated%c_max) &
            & .or. allocated(stated%anisotropy_cap)) then
            call refuse(error, 'c_min and c_max are needed together; anisotropy_cap needs both')
         else if (self%settings%surrogate%model == 'paper') then
            call refuse(error, 'the paper''s model needs c_min and c_max')
         else
            class = general_class
            if (allocated(stated%classes)) domain%members = join(stated%classes, ', ')
            domain%log_anisotropy_max = stated%log_anisotropy_max
            domain%poisson = [stated%poisson_min, stated%poisson_max]
         end if
         if (.not. allocated(error)) call complete_domain(class, domain, error)
         call self%locate('domain', '', error)
      end associate

   contains

      !> Set the range of the scale of the crystals, if the correction depends on the scale. The
      !> default range is a factor of 3 about the stiffness of the other parts of the specimen.
      subroutine set_range_of_scale()
         character(len=*), parameter :: names(2) = ['stiffness_min_gpa', 'stiffness_max_gpa']
         logical :: stated(2)
         real(wp) :: scale

         associate (asked => self%settings%domain, stiffness => domain%stiffness, &
            & is_paper => self%settings%surrogate%model == 'paper')
            stated = [allocated(asked%stiffness_min_gpa), allocated(asked%stiffness_max_gpa)]
            if (.not. any(stated)) then
               scale = 0.0_wp
               if (.not. is_paper) scale = specimen_stiffness(self%settings)
               if (scale > 0.0_wp) stiffness = scale*[1.0_wp/scale_factor, scale_factor]
            else if (is_paper) then
               call self%refuse('domain', names(findloc(stated, .true., 1)), 'the paper''s model ' &
                  & //'has no scale apart from its constants; allowed with ' &
                  & //'model = ''correction''', error)
            else if (.not. all(stated)) then
               call self%refuse('domain', names(findloc(stated, .false., 1)), 'the variable is ' &
                  & //'missing; '//names(findloc(stated, .true., 1))//' needs it', error)
            else
               stiffness = [asked%stiffness_min_gpa, asked%stiffness_max_gpa]
               if (.not. stiffness(1) < stiffness(2)) then
                  call self%refuse('domain', names(1), to_text(stiffness(1))//' GPa is not below ' &
                     & //'the stiffness_max_gpa of '//to_text(stiffness(2))//' GPa', error)
               end if
            end if
         end associate
      end subroutine set_range_of_scale
   end subroutine domain_of

   !> Read the pairs of degree and bandlimit, (2, n), of a scan. A blank text has none.
   pure subroutine read_scan(text, pairs, error)
      character(len=*), intent(in) :: text
      integer, allocatable, intent(out) :: pairs(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: degrees(:), bandlimits(:)
      integer :: i, j, sign_position

      allocate (pairs(2, 0))
      if (len_trim(text) == 0) return
      sign_position = scan(text, 'xX')
      if (sign_position > 0) then
         call read_list(text(:sign_position - 1), degrees)
         call read_list(text(sign_position + 1:), bandlimits)
         pairs = reshape([((degrees(i), bandlimits(j), j=1, size(bandlimits)), i=1, &
            & size(degrees))], [2, size(degrees)*size(bandlimits)])
      end if
      if (size(pairs) == 0) then
         call refuse(error, ''''//printable(text) &
            & //''' is not of the form ''1, 2, 3 x 8, 10, 12'' (degrees x bandlimits)')
      end if
   end subroutine read_scan

   !> Read the integers of a list. The result is empty if an item is not an integer.
   pure subroutine read_list(text, list)
      character(len=*), intent(in) :: text
      integer, allocatable, intent(out) :: list(:)
      character(len=len(text)), allocatable :: items(:)
      integer :: i, status

      items = split_list(text)
      allocate (list(size(items)))
      do i = 1, size(items)
         call read_integer(trim(items(i)), list(i), status)
         if (status /= number_ok) exit
      end do
      if (i <= size(items)) list = [integer ::]
   end subroutine read_list

end module build_checks
