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
      character(len=:), allocatable :: words, names(:)
      integer :: i, nearest

      words = ''
      names = split_list(allowed)
      if (size(names) == 0) return
      associate (distances => [(edit_distance(trim(names(i)), written), i=1, size(names))])
         nearest = minloc(distances, dim=1)
         if (distances(nearest) <= max(1, len_trim(names(nearest))/3)) words = ', did you mean '//trim(names(nearest))//'?'
      end associate
   end function suggestion

   !> Levenshtein's distance.
   pure integer function edit_distance(a, b) result(distance)
      character(len=*), intent(in) :: a, b
      integer :: previous(0:len(b)), current(0:len(b)), i, j

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
