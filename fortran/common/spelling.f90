!> What was probably meant by a name that nobody knows.
module spelling
   use text, only: split_list
   implicit none
   private
   public :: suggestion

contains

   !> ', did you mean X?' with the nearest of the allowed names, or nothing if none is near.
   pure function suggestion(written, allowed) result(words)
      !> The name that is not known.
      character(len=*), intent(in) :: written
      !> Names, separated by ', '.
      character(len=*), intent(in) :: allowed
      character(len=:), allocatable :: words
      character(len=:), allocatable :: names(:), nearest
      integer :: i, distance, least

      names = split_list(allowed)
      words = ''
      least = huge(least)
      do i = 1, size(names)
         distance = edit_distance(trim(names(i)), written)
         if (distance >= least) cycle
         least = distance
         nearest = trim(names(i))
      end do
      if (.not. allocated(nearest)) return
      if (least <= max(1, len(nearest)/3)) words = ', did you mean '//nearest//'?'
   end function suggestion

   !> Levenshtein's distance.
   pure integer function edit_distance(a, b) result(distance)
      character(len=*), intent(in) :: a, b
      integer :: previous(0:len(b)), current(0:len(b))
      integer :: i, j

      previous = [(j, j=0, len(b))]
      do i = 1, len(a)
         current(0) = i
         do j = 1, len(b)
            current(j) = min(previous(j) + 1, current(j - 1) + 1, previous(j - 1) + merge(0, 1, a(i:i) == b(j:j)))
         end do
         previous = current
      end do
      distance = previous(len(b))
   end function edit_distance
end module spelling
