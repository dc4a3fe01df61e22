!> Derivatives of terms and of y by the crystal, which a regression takes as observations beside y.
!>
!> They are by coordinates of the logarithm of the stiffness. A logarithmic basis is for all
!> crystals, and the coordinates are all 21, of which some combinations are turns of the crystal.
!> Other bases are for one class: the coordinates are those of the class, and two angles.
module modulus_slopes
   use abstract_basis, only: basis_type, spread_of
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use errors, only: error_type
   use kinds, only: degree, wp
   use logarithmic_coordinates, only: log_coordinates_type, new_log_coordinates
   implicit none
   private
   public :: evaluate_slopes, count_slopes, takes_slopes

contains

   !> Whether a basis is trained on derivatives. Where y depends on the scale, the polynomials fit
   !> values at the posterior better than values and derivatives together.
   pure logical function takes_slopes(basis)
      class(basis_type), intent(in) :: basis

      takes_slopes = basis%settings%derivatives .and. .not. basis%domain%has_scale()
   end function takes_slopes

   !> Number of derivatives of each crystal.
   pure integer function count_slopes(basis)
      class(basis_type), intent(in) :: basis

      count_slopes = merge(21, basis%domain%class%n_constants + 2, basis%logarithmic)
   end function count_slopes

   !> Derivatives of spread times the terms, and of spread times y, over the spread of the crystal,
   !> by central differences.
   subroutine evaluate_slopes(basis, constants, euler_deg, terms, y, modulus, by_stiffness)
      class(basis_type), intent(in) :: basis
      !> Of the domain's class, GPa; Bunge-Euler angles, degrees.
      real(wp), intent(in) :: constants(:), euler_deg(3)
      !> (n_terms, derivative).
      real(wp), intent(out) :: terms(:, :)
      !> (derivative).
      real(wp), intent(out), optional :: y(:)
      !> A modulus, GPa, and its derivatives by C11, C12, .. C66 in crystal axes.
      real(wp), intent(in), optional :: modulus, by_stiffness(:)
      real(wp), parameter :: step = 1.0e-4_wp
      type(crystal_class_type) :: class
      type(log_coordinates_type) :: logarithms
      type(error_type), allocatable :: error
      real(wp), dimension(2*size(terms, 2)) :: scale, spread, value
      real(wp) :: c(6, 6, size(scale)), euler(3, size(scale)), near(size(terms, 1), size(scale)), &
         & start(6, 6), axes(3, 3), w(21), v(21), change(6, 6)
      integer :: i, j, k, m, n

      class = basis%domain%class
      start = class%stiffness(constants)
      if (basis%logarithmic) call new_crystal_class(general_class, class, error)
      logarithms = new_log_coordinates(class)
      n = logarithms%n
      w(:n) = logarithms%to_logarithms(start)
      do j = 1, size(scale)
         k = (j + 1)/2
         c(:, :, j) = start
         euler(:, j) = degree*euler_deg
         if (k <= n) then
            v = w
            v(k) = w(k) + (-1)**j*step
            c(:, :, j) = logarithms%from_logarithms(v(:n))
         else
            euler(k - n + 1, j) = euler(k - n + 1, j) + (-1)**j*step
         end if
      end do
      call basis%evaluate_many(c, euler, near, scale, spread)
      do j = 1, size(scale)
         near(:, j) = spread(j)*near(:, j)
      end do
      associate (width => 2.0_wp*step*spread_of(basis%noise_growth, start))
         terms = (near(:, 2::2) - near(:, 1::2))/width
         if (.not. present(y)) return
         axes = rotation_matrix(degree*euler_deg)
         do m = 1, size(scale)
            change = rotate_stiffness(rotate_stiffness(c(:, :, m), rotation_matrix(euler(:, m))), &
               & transpose(axes)) - start
            value(m) = modulus + dot_product(by_stiffness, [((change(i, j), j=i, 6), i=1, 6)])
         end do
         value = spread*basis%to_y(value, scale, spread)
         y = (value(2::2) - value(1::2))/width
      end associate
   end subroutine evaluate_slopes
end module modulus_slopes
