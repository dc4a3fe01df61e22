!> The distribution of chi-square.
module chi_square
   use kinds, only: wp
   implicit none
   private
   public :: chi_square_above

contains

   !> The probability that chi-square with `freedom` degrees of freedom is above `value`: the incomplete gamma function Q(k/2, x/2), by its
   !> series below the mean and by its continued fraction above (Abramowitz and Stegun 6.5.29, 6.5.31).
   pure real(wp) function chi_square_above(value, freedom) result(share)
      real(wp), intent(in) :: value
      !> At least 1.
      integer, intent(in) :: freedom
      integer, parameter :: most_terms = 100000
      real(wp) :: a, x, term, total, b, c, d
      integer :: i

      a = 0.5_wp*freedom
      x = 0.5_wp*value
      if (x <= 0.0_wp) then
         share = 1.0_wp
      else if (x < a + 1.0_wp) then
         term = 1.0_wp/a
         total = term
         do i = 1, most_terms
            term = term*x/(a + i)
            total = total + term
            if (term < epsilon(total)*total) exit
         end do
         share = 1.0_wp - total*exp(a*log(x) - x - log_gamma(a))
      else
         b = x + 1.0_wp - a
         c = 1.0_wp/tiny(c)
         d = 1.0_wp/b
         total = d
         do i = 1, most_terms
            b = b + 2.0_wp
            term = -i*(i - a)
            d = 1.0_wp/(term*d + b)
            c = b + term/c
            total = total*d*c
            if (abs(d*c - 1.0_wp) < epsilon(total)) exit
         end do
         share = total*exp(a*log(x) - x - log_gamma(a))
      end if
   end function chi_square_above
end module chi_square
