!> Rivals of the orientations: other readings of the same table or map, and grains in any order.
module order_rivals
   use crystal_elasticity, only: euler_angles, rotation_matrix
   use direction_columns, only: angles_of_direction
   use kinds, only: degree, wp
   use rival_cases, only: case_type, rival_type
   implicit none
   private
   public :: make_reading, make_any_order

   !> Mistaken axes and their signs. Mistake k exchanges x and y if k is above 3, then reverses x if
   !> k has the bit 1, and y if it has the bit 2.
   character(len=*), parameter :: mistakes(7) = [character(len=35) :: 'x reversed', 'y reversed', &
      & 'x and y reversed', 'x and y exchanged', 'x and y exchanged, then x reversed', &
      & 'x and y exchanged, then y reversed', 'x and y exchanged and reversed']
   integer, parameter :: signs(3, 7) = reshape([-1, 1, 1, 1, -1, 1, -1, -1, 1, 1, 1, 1, -1, 1, 1, &
      & 1, -1, 1, -1, -1, 1], [3, 7])
   !> Other readings of the same table. The last ones are of the map from which the table comes.
   character(len=*), parameter, public :: readings(20) = [character(len=57) :: &
      & 'rotations from crystal to sample axes (the inverse)', &
      & 'the x axis of the sample as the indented one', &
      & 'the y axis of the sample as the indented one', 'the orientations in reverse order', &
      & 'the orientations one row further down', 'the orientations one row further up', &
      & 'the crystal axes with '//mistakes, 'the map with '//mistakes]
   integer, parameter :: of_order = 4, of_axes = 7, of_map = 14

contains

   !> The reading k.
   subroutine make_reading(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      real(wp) :: g(3, 3), direction(3)
      integer :: i, n

      if (k > size(readings)) return
      rival%explanation = trim(readings(k))
      n = size(case%points)
      if (k >= of_map .and. .not. allocated(case%problem%data%misread)) return
      ! Not all rows are compared: their order says nothing.
      if (k >= of_order .and. k < of_axes .and. n < case%problem%data%measurements%n) return
      do i = 1, n
         g = rotation_matrix(case%stated%data%euler(:, i))
         select case (k)
         case (1)
            rival%data%euler(:, i) = euler_angles(transpose(g))
            cycle
         case (2, 3)
            direction = g(:, k - 1)
         case (of_order)
            rival%data%euler(:, i) = case%stated%data%euler(:, n + 1 - i)
            cycle
         case (of_order + 1)
            rival%data%euler(:, i) = case%stated%data%euler(:, 1 + modulo(i - 2, n))
            cycle
         case (of_order + 2)
            rival%data%euler(:, i) = case%stated%data%euler(:, 1 + modulo(i, n))
            cycle
         case (of_axes:of_map - 1)
            associate (mistake => k - of_axes + 1)
               direction = signs(:, mistake)*g(merge([2, 1, 3], [1, 2, 3], mistake > 3), 3)
            end associate
         case default
            associate (row => findloc(case%problem%data%measurements%of_row, case%points(i), dim=1))
               direction = case%problem%data%misread(:, row, k - of_map + 1)
            end associate
         end select
         rival%data%euler(:, i) = angles_of_direction(direction)*degree
      end do
      rival%differs = .true.
   end subroutine make_reading

   !> Each modulus is of any of the orientations.
   subroutine make_any_order(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      integer :: n

      if (k > 1) return
      rival%explanation = 'the orientations in any other order'
      rival%remedy = 'orientations = ''unknown'''
      n = size(case%points)
      rival%data%probability = spread(1.0_wp/n, 1, n)
      rival%data%tilt_sd = spread(0.0_wp, 1, n)
      rival%settings%misalignment_sd_deg = 0.0_wp
      rival%settings%likelihood = 'normal'
      rival%differs = .not. case%stated%infers_scale
   end subroutine make_any_order

end module order_rivals
