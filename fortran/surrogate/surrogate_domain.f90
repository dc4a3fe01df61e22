!> The crystals for which a surrogate is valid, and samples of them.
module surrogate_domain
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: anisotropy_index, is_stable, logarithmic_mean
   use errors, only: error_type, refuse
   use kinds, only: pi, wp
   use labelled_values, only: labelled_values_type
   use logarithmic_coordinates, only: log_coordinates_type, new_log_coordinates
   use random, only: new_random_stream, random_stream_type
   use text, only: split_list, to_text
   implicit none
   private
   public :: domain_type, complete_domain, exchange_domain, spread_crystals

   !> Born-stable crystals of a class within limits. The limits are bounds of the constants and a
   !> cap on Eq. 14, or ranges of the log-anisotropy, of Poisson's ratio of the isotropic part of
   !> log K, and of the scale. Limits that are not stated do not apply.
   type :: domain_type
      !> Class whose constants describe the crystals; every crystal of the domain has its symmetry.
      type(crystal_class_type) :: class
      !> Names, separated by ', ', of the classes of the crystals that are spread over the domain.
      character(len=:), allocatable :: members
      !> Bounds of the constants, GPa, (n_constants), or of size 0.
      real(wp), allocatable :: lower(:), upper(:)
      real(wp) :: anisotropy_cap = huge(1.0_wp), log_anisotropy_max = huge(1.0_wp), &
         & poisson(2) = [-1.0_wp, 0.5_wp]
      !> Range of the scale, GPa: the geometric mean of the six eigenvalues of the Kelvin stiffness,
      !> exp(tr log K/6). Where it is stated the specimen correction depends on the scale. Bounds of
      !> the constants take precedence over it.
      real(wp) :: stiffness(2) = [0.0_wp, huge(1.0_wp)]
      !> Whether a correction beyond the limits of invariants is that of the nearest crystal within
      !> them. The limits then do not apply to the crystals that are inferred. Not stored.
      logical :: is_extended = .false.
   contains
      procedure :: has_scale, is_limited, admits, is_of_class, normalised_distance, coordinates_of
      procedure :: nearest, support
   end type domain_type

contains

   !> Set the class of a domain whose limits are stated, and check it. Without members the class is
   !> the only member. Members that are not crystals of the class, and limits that are not ranges,
   !> are refused.
   subroutine complete_domain(class, domain, error)
      !> Name or synonym of the crystal class.
      character(len=*), intent(in) :: class
      type(domain_type), intent(inout) :: domain
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: member
      character(len=:), allocatable :: names(:)
      integer :: i

      call new_crystal_class(class, domain%class, error)
      if (allocated(error)) return
      if (.not. allocated(domain%members)) domain%members = domain%class%name
      if (.not. allocated(domain%lower)) allocate (domain%lower(0), domain%upper(0))
      allocate (names, source=split_list(domain%members))
      do i = 1, size(names)
         call new_crystal_class(trim(names(i)), member, error)
         if (allocated(error)) return
         if (domain%class%includes(member)) cycle
         call refuse(error, trim(names(i))//' crystals are no '//domain%class%name//' ones')
         return
      end do
      associate (n => domain%class%n_constants, lower => domain%lower, upper => domain%upper, &
         & poisson => domain%poisson, stiffness => domain%stiffness)
         if (.not. any(size(lower) == [0, n]) .or. size(upper) /= size(lower)) then
            call refuse(error, 'the domain of '//domain%class%name &
               & //' crystals has bounds for each of '//to_text(n)//' constants, not ' &
               & //to_text(size(lower))//' and '//to_text(size(upper)))
            return
         end if
         i = findloc(upper - lower > 0.0_wp .and. upper - lower < huge(1.0_wp), .false., 1)
         if (i > 0) then
            call refuse(error, 'the bounds of '//domain%class%constants(i) &
               & //' are '//to_text(lower(i))//' and '//to_text(upper(i)) &
               & //' GPa; the lower must be below the upper')
         else if (.not. (domain%anisotropy_cap > 0.0_wp &
            & .and. domain%anisotropy_cap <= huge(1.0_wp))) then
            call refuse(error, 'anisotropy_cap = '//to_text(domain%anisotropy_cap) &
               & //' must be positive')
         else if (.not. (domain%log_anisotropy_max > 0.0_wp)) then
            call refuse(error, 'log_anisotropy_max = '//to_text(domain%log_anisotropy_max) &
               & //' must be positive')
         else if (size(lower) == 0 .and. .not. (poisson(1) > -1.0_wp .and. poisson(1) < poisson(2) &
            & .and. poisson(2) < 0.5_wp)) then
            call refuse(error, 'Poisson''s ratios from '//to_text(poisson(1))//' to ' &
               & //to_text(poisson(2))//' are no range within -1 .. 0.5')
         else if (.not. (merge(stiffness(1) > 0.0_wp, stiffness(1) <= 0.0_wp, domain%has_scale()) &
            & .and. stiffness(1) < stiffness(2))) then
            call refuse(error, &
               & 'stiffnesses from '//to_text(stiffness(1))//' to '//to_text(stiffness(2)) &
               & //' GPa are no range; the least must be positive and below the greatest')
         end if
      end associate
   end subroutine complete_domain

   !> Whether a range of the scale is stated.
   pure logical function has_scale(self)
      class(domain_type), intent(in) :: self

      has_scale = self%stiffness(2) < huge(1.0_wp)
   end function has_scale

   !> The crystals at which the surrogate may be evaluated: the domain, or all stable crystals of
   !> its class if it is extended.
   pure type(domain_type) function support(self)
      class(domain_type), intent(in) :: self

      support%class = self%class
      support%members = self%members
      support%lower = self%lower
      support%upper = self%upper
      support%is_extended = self%is_extended
      if (self%is_extended) return
      support%anisotropy_cap = self%anisotropy_cap
      support%log_anisotropy_max = self%log_anisotropy_max
      support%poisson = self%poisson
      support%stiffness = self%stiffness
   end function support

   !> Coordinates of log K of the crystal within the limits of an extended domain that is nearest to
   !> one.
   pure function nearest(self, w)
      class(domain_type), intent(in) :: self
      !> Coordinates of log K in any class, the first two those of the isotropic part.
      real(wp), intent(in) :: w(:)
      real(wp) :: nearest(size(w)), between, mean

      nearest = w
      if (.not. self%is_extended) return
      associate (least => log((1.0_wp + self%poisson)/(1.0_wp - 2.0_wp*self%poisson)), &
         & scale => log(self%stiffness))
         between = max(least(1), min(least(2), w(1) - w(2)/sqrt(5.0_wp)))
         mean = max(scale(1), min(scale(2), (w(1) + sqrt(5.0_wp)*w(2))/6.0_wp))
      end associate
      nearest(1) = mean + 5.0_wp/6.0_wp*between
      nearest(2) = sqrt(5.0_wp)*(mean - between/6.0_wp)
      nearest(3:) = w(3:)*min(1.0_wp, self%log_anisotropy_max/max(norm2(w(3:)), tiny(1.0_wp)))
   end function nearest

   !> Whether the domain excludes any stable crystal of its class.
   pure logical function is_limited(self)
      class(domain_type), intent(in) :: self

      is_limited = size(self%lower) > 0 &
         & .or. min(self%anisotropy_cap, self%log_anisotropy_max) < huge(1.0_wp)
   end function is_limited

   !> Write a domain, or read it.
   subroutine exchange_domain(domain, file)
      type(domain_type), intent(inout) :: domain
      type(labelled_values_type), intent(inout) :: file
      type(error_type), allocatable :: error
      character(len=:), allocatable :: name
      real(wp), allocatable :: poisson(:), scale(:)

      if (.not. file%reading) name = domain%class%name
      poisson = domain%poisson
      scale = domain%stiffness
      call file%text('symmetry', name)
      call file%text('classes', domain%members)
      call file%reals('c_min', domain%lower)
      call file%reals('c_max', domain%upper)
      call file%real('anisotropy_cap', domain%anisotropy_cap)
      call file%real('log_anisotropy_max', domain%log_anisotropy_max)
      call file%reals('poisson', poisson)
      call file%reals('stiffness', scale)
      if (allocated(file%error) .or. .not. file%reading) return
      if (size(poisson) /= 2 .or. size(scale) /= 2) then
         call file%fail('the limits of the domain are no ranges')
      else
         domain%poisson = poisson
         domain%stiffness = scale
         call complete_domain(name, domain, error)
         if (allocated(error)) call file%fail(error%message)
      end if
   end subroutine exchange_domain

   !> Whether a crystal is in the domain, to rounding.
   pure logical function admits(self, c)
      class(domain_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp), parameter :: rounding = 1.0e-9_wp

      admits = .false.
      if (.not. (self%is_of_class(c) .and. is_stable(c))) return
      if (self%anisotropy_cap < huge(1.0_wp)) then
         if (anisotropy_index(c) > self%anisotropy_cap) return
      end if
      admits = self%normalised_distance(c) <= 1.0_wp + rounding
   end function admits

   !> Whether a stiffness has the symmetry of the class in its axes.
   pure logical function is_of_class(self, c)
      class(domain_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp), parameter :: rounding = 1.0e-9_wp

      is_of_class = maxval(abs(c - self%class%stiffness(self%class%constants_of(c)))) &
         & <= rounding*maxval(abs(c))
   end function is_of_class

   !> Normalised distance of a stable crystal from the middle of the domain: the largest of the
   !> coordinates that have limits, each relative to its range; 1 on the boundary. The cap on Eq. 14
   !> is not among them.
   pure real(wp) function normalised_distance(self, c) result(distance)
      class(domain_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: poisson, anisotropy, stiffness

      distance = 0.0_wp
      if (size(self%lower) > 0) then
         distance = maxval(abs(self%coordinates_of(c)))
      else if (self%log_anisotropy_max < huge(1.0_wp)) then
         call logarithmic_mean(c, poisson, anisotropy, stiffness)
         distance = max(anisotropy/self%log_anisotropy_max, &
            & abs(position(poisson, self%poisson(1), self%poisson(2))))
         if (self%has_scale()) then
            distance = max(distance, &
               & abs(position(log(stiffness), log(self%stiffness(1)), log(self%stiffness(2)))))
         end if
      end if
   end function normalised_distance

   !> The constants of a crystal, mapped from their bounds to [-1, 1].
   pure function coordinates_of(self, c) result(x)
      class(domain_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: x(size(self%lower))

      x = position(self%class%constants_of(c), self%lower, self%upper)
   end function coordinates_of

   !> A value, mapped from its range to [-1, 1].
   pure elemental real(wp) function position(value, least, greatest)
      real(wp), intent(in) :: value, least, greatest

      position = (2.0_wp*value - least - greatest)/(greatest - least)
   end function position

   !> A Latin hypercube of n crystals of the domain, with indentation directions uniform on the
   !> sphere.
   subroutine spread_crystals(domain, n, seed, constants, euler_deg, error)
      type(domain_type), intent(in) :: domain
      integer, intent(in) :: n, seed
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), allocatable, intent(out) :: constants(:, :), euler_deg(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> Points of a Latin hypercube, (coordinate, point); the unit interval's numbers that become
      !> angles, (3, n).
      real(wp), allocatable :: points(:, :), angles(:, :)

      allocate (euler_deg(3, n))
      if (size(domain%lower) > 0) then
         call spread_in_box()
         if (allocated(error)) return
      else
         call latin_hypercube(merge(6, 5, domain%has_scale()), n)
         call spread_logarithms()
         angles = points(3:5, :)
      end if
      ! Phi within 0..90: a direction and its opposite are the same indentation.
      euler_deg(1, :) = 360.0_wp*angles(1, :)
      euler_deg(2, :) = acos(1.0_wp - angles(2, :))*180.0_wp/pi
      euler_deg(3, :) = 360.0_wp*angles(3, :)

   contains

      !> The first n points of a Latin hypercube whose crystals are in the domain: constants between
      !> their bounds, and three numbers of the unit interval.
      subroutine spread_in_box()
         integer, parameter :: most_points = 4000000
         integer :: k, i, n_admitted, points_needed

         k = domain%class%n_constants
         points_needed = n
         allocate (constants(k, 0), angles(3, 0))
         if (n == 0) return
         do while (points_needed <= most_points)
            call latin_hypercube(k + 3, points_needed)
            ! Array constructors would be on the stack, and these arrays are large.
            n_admitted = 0
            do i = 1, size(points, 2)
               points(:k, i) = domain%lower + points(:k, i)*(domain%upper - domain%lower)
               if (.not. domain%admits(domain%class%stiffness(points(:k, i)))) cycle
               n_admitted = n_admitted + 1
               points(:, n_admitted) = points(:, i)
               if (n_admitted < n) cycle
               constants = points(:k, :n)
               angles = points(k + 1:, :n)
               return
            end do
            points_needed = ceiling(min(4.0_wp*points_needed, &
               & 1.02_wp*points_needed*n/max(1, n_admitted) + 8.0_wp))
         end do
         call refuse(error, 'the domain holds (almost) no stable crystal below its anisotropy ' &
            & //'cap of '//to_text(domain%anisotropy_cap))
      end subroutine spread_in_box

      !> Crystals whose log(3K/2G) and log-anisotropy follow the first two rows of `points` (5 or 6,
      !> n) over their ranges. The directions of the anisotropy are random, and the classes of the
      !> domain alternate. The logarithm of their scale follows row 6, or is that of 100 GPa.
      subroutine spread_logarithms()
         real(wp), parameter :: typical_scale = 100.0_wp
         type(crystal_class_type) :: member
         type(log_coordinates_type), allocatable :: coordinates(:)
         type(random_stream_type) :: stream
         character(len=:), allocatable :: names(:)
         real(wp) :: contrast(2), between, mean, w(21)
         integer :: i, k

         allocate (names, source=split_list(domain%members))
         allocate (coordinates(size(names)), constants(domain%class%n_constants, n))
         do i = 1, size(names)
            call new_crystal_class(trim(names(i)), member, error)
            if (allocated(error)) return
            coordinates(i) = new_log_coordinates(member)
         end do
         contrast = log((1.0_wp + domain%poisson)/(1.0_wp - 2.0_wp*domain%poisson))
         stream = new_random_stream(seed, 1)
         do i = 1, n
            associate (space => coordinates(1 + mod(i - 1, size(names))))
               between = contrast(1) + points(1, i)*(contrast(2) - contrast(1))
               mean = log(typical_scale)
               if (domain%has_scale()) then
                  mean = (1.0_wp - points(6, i))*log(domain%stiffness(1)) &
                     & + points(6, i)*log(domain%stiffness(2))
               end if
               w(1) = mean + 5.0_wp/6.0_wp*between
               w(2) = sqrt(5.0_wp)*(mean - between/6.0_wp)
               k = space%n
               call stream%normals(w(3:k))
               if (k > 2) w(3:k) = domain%log_anisotropy_max*points(2, i)*w(3:k)/norm2(w(3:k))
               constants(:, i) = domain%class%constants_of(space%from_logarithms(w(:k)))
            end associate
         end do
      end subroutine spread_logarithms

      !> A Latin hypercube: points of m coordinates in the unit interval, `total` of them. In each
      !> coordinate, each of as many equal parts has one point.
      subroutine latin_hypercube(m, total)
         integer, intent(in) :: m, total
         type(random_stream_type) :: stream
         integer, allocatable :: order(:)
         real(wp) :: u
         integer :: i, j, k

         if (allocated(points)) deallocate (points)
         allocate (points(m, total), order(total))
         stream = new_random_stream(seed, 0)
         do j = 1, m
            do i = 1, total
               order(i) = i
            end do
            do i = total, 2, -1
               call stream%pick(i, k)
               order([k, i]) = order([i, k])
            end do
            do i = 1, total
               call stream%uniform(u)
               points(j, i) = (order(i) - u)/total
            end do
         end do
      end subroutine latin_hypercube
   end subroutine spread_crystals

end module surrogate_domain
