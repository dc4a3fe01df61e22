!> Named quantities of a crystal, computed from its stiffness, for every crystal class: constants,
!> averages, directional moduli, and products of powers of these.
module quantities
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: averages_type, anisotropy_index, polycrystal_averages
   use errors, only: error_type, refuse, suggestion
   use kinds, only: wp
   use text, only: join, lower, number_ok, read_real, split_list, to_text
   implicit none
   private
   public :: quantity_type, new_quantity, new_quantities, check_quantity, check_distinct, &
      & check_value, reported_quantities, typical_crystal
   public :: evaluate_draws, evaluate_quantities, quantity_choices

   !> Names without and names with a direction.
   character(len=*), parameter :: plain_names = 'bulk_modulus, polycrystal_bulk, ' &
      & //'polycrystal_shear, polycrystal_young, polycrystal_poisson, anisotropy_index', &
      & directional_names = 'young, shear, compressibility'
   !> The names that are allowed, for messages and the schema.
   character(len=*), parameter :: quantity_choices = 'a constant C11 .. ' &
      & //'C66, C'' = (C11 - C12)/2, '//plain_names//', young[100], shear[001], ' &
      & //'compressibility[100], or a product of powers of these such as C33/C11 or C11^1 C12^-0.3'

   !> One factor of a product: a name, the entry of the stiffness or the direction that it refers
   !> to, and a power.
   type :: factor_type
      character(len=19) :: word = ''
      integer :: row = 0, column = 0
      !> Unit vector in crystal axes.
      real(wp) :: direction(3) = 0.0_wp
      real(wp) :: power = 1.0_wp
   end type factor_type

   type :: quantity_type
      !> The name as the user wrote it.
      character(len=:), allocatable :: name
      !> 'GPa', '1/TPa', '1' for a ratio, or a power of GPa.
      character(len=:), allocatable :: unit
      type(factor_type), allocatable, private :: factors(:)
   contains
      procedure :: is_product
   end type quantity_type

contains

   !> Parse the name of a quantity.
   subroutine new_quantity(name, quantity, error)
      character(len=*), intent(in) :: name
      type(quantity_type), intent(out) :: quantity
      type(error_type), allocatable, intent(out) :: error
      type(factor_type) :: factor
      character(len=:), allocatable :: word, power
      real(wp) :: power_sign, exponent
      integer :: i, caret, word_start, outcome
      logical :: in_brackets

      quantity%name = trim(adjustl(name))
      allocate (quantity%factors(0))
      i = 1
      power_sign = 1.0_wp
      do while (i <= len(name))
         if (index(' */', name(i:i)) > 0) then
            if (name(i:i) == '/') power_sign = -1.0_wp
            i = i + 1
            cycle
         end if
         word_start = i
         in_brackets = .false.
         do while (i <= len(name))
            if (name(i:i) == '[') in_brackets = .true.
            if (name(i:i) == ']') in_brackets = .false.
            if (.not. in_brackets .and. index(' */', name(i:i)) > 0) exit
            i = i + 1
         end do
         word = name(word_start:i - 1)
         caret = index(word, '^')
         power = '1'
         if (caret > 0) then
            power = word(caret + 1:)
            word = word(:caret - 1)
         end if
         call read_real(power, exponent, outcome)
         if (outcome == number_ok) then
            call read_word(word, factor, error)
         else
            call refuse(error, ''''//trim(name)//''': the power '''//power//''' is not a number')
         end if
         if (allocated(error)) return
         factor%power = power_sign*exponent
         power_sign = 1.0_wp
         quantity%factors = [quantity%factors, factor]
      end do
      if (size(quantity%factors) == 0) then
         call refuse(error, 'the name of the quantity is empty; allowed: '//quantity_choices)
      end if
      quantity%unit = unit_of(quantity%factors)
   end subroutine new_quantity

   !> Read a constant, a name, or a name with a direction.
   subroutine read_word(text, factor, error)
      character(len=*), intent(in) :: text
      type(factor_type), intent(out) :: factor
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: word
      integer :: bracket
      logical :: known

      bracket = index(text, '[')
      word = lower(text)
      if (bracket > 0) word = lower(text(:bracket - 1))
      factor%word = word
      if (bracket > 0) then
         known = any(split_list(directional_names) == word)
         if (known) call read_direction(text(bracket:), factor%direction, known)
      else if (word == 'c''') then
         known = .true.
      else if (len(word) == 3 .and. verify(word, 'c123456') == 0) then
         factor%row = index('123456', word(2:2))
         factor%column = index('123456', word(3:3))
         known = word(1:1) == 'c' .and. factor%row > 0 .and. factor%column >= factor%row
         factor%word = 'constant'
      else
         known = any(split_list(plain_names) == word)
      end if
      if (.not. known) then
         call refuse(error, ''''//text//''' is unknown'//suggestion(word, plain_names &
            & //', young[100], shear[100], compressibility[100]')//'; allowed: '//quantity_choices)
      end if
   end subroutine read_word

   !> Read a direction: '[110]', '[1-10]', or separate numbers, '[1 0.5 0]'. For a hexagonal crystal
   !> also [0001], or the four indices of a direction in the basal plane.
   subroutine read_direction(text, direction, is_valid)
      character(len=*), intent(in) :: text
      real(wp), intent(out) :: direction(3)
      !> Whether the text is a direction: three numbers, not all zero.
      logical, intent(out) :: is_valid
      character(len=:), allocatable :: inner, spaced
      real(wp) :: four(4)
      integer :: i, status

      direction = 0.0_wp
      is_valid = .false.
      i = len(text)
      if (text(i:i) /= ']' .or. i < 5) return
      inner = text(2:i - 1)
      if (verify(inner, '0123456789-+., eE') > 0) return
      spaced = ''
      do i = 1, len(inner)
         spaced = spaced//inner(i:i)
         if (scan(trim(inner), ' ,.') == 0 .and. verify(inner(i:i), '-+') > 0) spaced = spaced//' '
      end do
      read (spaced, *, iostat=status) four
      if (status == 0) then
         direction = [four(1) - 0.5_wp*(four(2) + four(3)), &
            & sqrt(0.75_wp)*(four(2) - four(3)), four(4)]
         ! Other four-index directions depend on the axial ratio of the unit cell.
         if (any(abs(four(:3)) > 0.0_wp) .and. abs(four(4)) > 0.0_wp &
            & .or. abs(sum(four(:3))) > 0.0_wp) then
            direction = 0.0_wp
         end if
      else
         read (spaced, *, iostat=status) direction
      end if
      is_valid = status == 0 .and. sum(direction**2) > 0.0_wp .and. all(abs(direction) < 1.0e6_wp)
      if (is_valid) direction = direction/norm2(direction)
   end subroutine read_direction

   !> The unit of a product of factors.
   pure function unit_of(factors) result(unit)
      type(factor_type), intent(in) :: factors(:)
      character(len=:), allocatable :: unit
      real(wp) :: power
      integer :: i

      power = 0.0_wp
      do i = 1, size(factors)
         select case (factors(i)%word)
         case ('polycrystal_poisson', 'anisotropy_index')
            cycle
         case ('compressibility')
            power = power - factors(i)%power
         case default
            power = power + factors(i)%power
         end select
      end do
      unit = 'GPa^'//to_text(power)
      if (abs(power) < 1.0e-9_wp) unit = '1'
      if (abs(power - 1.0_wp) < 1.0e-9_wp) unit = 'GPa'
      if (size(factors) == 1 .and. abs(power + 1.0_wp) < 1.0e-9_wp) then
         if (factors(1)%word == 'compressibility') unit = '1/TPa'
      end if
   end function unit_of

   !> Whether the quantity is more than one factor of power one.
   pure logical function is_product(self)
      class(quantity_type), intent(in) :: self

      is_product = size(self%factors) > 1 .or. abs(self%factors(1)%power - 1.0_wp) > 0.0_wp
   end function is_product

   !> Refuse a quantity that is zero, or infinite, in every crystal of the class.
   subroutine check_quantity(quantity, class, error)
      type(quantity_type), intent(in) :: quantity
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: values(1)

      call evaluate_quantities([quantity], typical_crystal(class, 0), values)
      if (.not. (abs(values(1)) > 1.0e-9_wp .and. abs(values(1)) < huge(1.0_wp))) then
         call refuse(error, ''''//quantity%name//''' is zero, or not finite, for every ' &
            & //class%name//' crystal')
      end if
   end subroutine check_quantity

   !> Refuse a value that no solid can have.
   pure subroutine check_value(quantity, value, error)
      type(quantity_type), intent(in) :: quantity
      !> Value in the unit of the quantity.
      real(wp), intent(in) :: value
      type(error_type), allocatable, intent(out) :: error
      !> Wide enough for soft polymers and diamond.
      real(wp) :: range(2)
      character(len=:), allocatable :: unit

      range = merge([-200.0_wp, 1000.0_wp], [-500.0_wp, 2000.0_wp], quantity%unit == '1/TPa')
      if (quantity%name == 'polycrystal_poisson') range = [-1.0_wp, 0.5_wp]
      if (.not. any(quantity%unit == ['GPa  ', '1/TPa', '1    ']) &
         & .or. (value >= range(1) .and. value <= range(2))) then
         return
      end if
      unit = ' '//quantity%unit
      if (unit == ' 1') unit = ''
      call refuse(error, quantity%name//' = '//to_text(value)//unit//' is not that of a solid; ' &
         & //'allowed: '//to_text(range(1))//' .. '//to_text(range(2))//unit//'. Check the unit')
   end subroutine check_value

   !> Refuse two quantities if one follows from the other in every crystal of the class: if they are
   !> equal, or if one is a number times a power of the other.
   subroutine check_distinct(quantities, class, error)
      type(quantity_type), intent(in) :: quantities(:)
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: crystals = 5
      real(wp), parameter :: rounding = 1.0e-9_wp
      real(wp) :: logarithms(size(quantities), crystals)
      integer :: i, j

      do i = 1, crystals
         call evaluate_quantities(quantities, typical_crystal(class, i), logarithms(:, i))
      end do
      logarithms = log(abs(logarithms))
      do j = 1, size(quantities)
         logarithms(j, :) = logarithms(j, :) - sum(logarithms(j, :))/crystals
         logarithms(j, :) = logarithms(j, :)/norm2(logarithms(j, :))
         do i = 1, j - 1
            if (abs(dot_product(logarithms(i, :), logarithms(j, :))) < 1.0_wp - rounding) cycle
            call refuse(error, ''''//quantities(j)%name//''' of a '//class%name//' crystal is ' &
               & //'the same as '''//quantities(i)%name//'''; a quantity may be given once')
            return
         end do
      end do
   end subroutine check_distinct

   !> A stable crystal of a class without accidental symmetry: every entry that the class allows is
   !> nonzero and distinct.
   pure function typical_crystal(class, number) result(c)
      type(crystal_class_type), intent(in) :: class
      !> Number of the crystal; each number gives another one.
      integer, intent(in) :: number
      real(wp) :: c(6, 6)
      integer :: i, j

      do j = 1, 6
         do i = 1, 6
            c(i, j) = 7.0_wp + 2.0_wp*sin(real(i*j + i + j, wp) + 1.3_wp*number*(i + j))
         end do
         c(j, j) = 150.0_wp + 10.0_wp*j + 30.0_wp*sin(real(number*j, wp))
      end do
      c = class%stiffness(class%constants_of(c))
   end function typical_crystal

   !> The quantities that are reported for a crystal class: its constants, averages, and Young's
   !> moduli along directions that are not equivalent in it.
   subroutine reported_quantities(class, list, error)
      type(crystal_class_type), intent(in) :: class
      type(quantity_type), allocatable, intent(out) :: list(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: directions = 'young[001], young[100], young[010], ' &
         & //'young[110], young[101], young[011], young[111]'

      call new_quantities(split_list(join(class%constants, ', ')//', '//plain_names//', ' &
         & //directions), class, size(class%constants), list, error)
   end subroutine reported_quantities

   !> Quantities by their names. The first `n_kept` are always in the list. Of the others, one that
   !> equals another before it for every crystal of the class is left out.
   subroutine new_quantities(names, class, n_kept, list, error)
      character(len=*), intent(in) :: names(:)
      type(crystal_class_type), intent(in) :: class
      integer, intent(in) :: n_kept
      type(quantity_type), allocatable, intent(out) :: list(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: rounding = 1.0e-9_wp
      type(quantity_type) :: candidates(size(names))
      real(wp) :: values(size(names))
      integer :: i, n

      n = 0
      do i = 1, size(names)
         n = n + 1
         call new_quantity(trim(names(i)), candidates(n), error)
         if (allocated(error)) return
         call evaluate_quantities(candidates(n:n), typical_crystal(class, 0), values(n:n))
         if (any(abs(values(n_kept + 1:n - 1) - values(n)) < rounding*abs(values(n)))) n = n - 1
      end do
      list = candidates(:n)
   end subroutine new_quantities

   !> Values of quantities for one stable crystal, each in its unit.
   pure subroutine evaluate_quantities(quantities, c, values)
      type(quantity_type), intent(in) :: quantities(:)
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp), intent(out) :: values(:)
      type(averages_type) :: averages
      integer :: i, j

      averages = polycrystal_averages(c)
      values = 1.0_wp
      do i = 1, size(quantities)
         do j = 1, size(quantities(i)%factors)
            associate (power => quantities(i)%factors(j)%power, &
               & value => value_of(quantities(i)%factors(j), c, averages))
               if (abs(abs(power) - 1.0_wp) <= 0.0_wp) then
                  values(i) = values(i)*value**nint(power)
               else
                  values(i) = values(i)*value**power
               end if
            end associate
         end do
      end do
   end subroutine evaluate_quantities

   !> Values of quantities for the crystals of many draws.
   pure subroutine evaluate_draws(quantities, class, draws, values)
      type(quantity_type), intent(in) :: quantities(:)
      type(crystal_class_type), intent(in) :: class
      !> (parameter, draw); the first parameters are the constants, GPa.
      real(wp), intent(in) :: draws(:, :)
      !> (quantity, draw).
      real(wp), allocatable, intent(out) :: values(:, :)
      integer :: i

      allocate (values(size(quantities), size(draws, 2)))
      do i = 1, size(draws, 2)
         call evaluate_quantities(quantities, class%stiffness(draws(:class%n_constants, i)), &
            & values(:, i))
      end do
   end subroutine evaluate_draws

   !> Value of a factor without its power. A directional quantity is the response along a direction:
   !> Young's or the torsional shear modulus, GPa, or the linear compressibility, 1/TPa.
   pure real(wp) function value_of(factor, c, averages) result(value)
      type(factor_type), intent(in) :: factor
      !> GPa, and the averages over a polycrystal of it.
      real(wp), intent(in) :: c(6, 6)
      type(averages_type), intent(in) :: averages
      real(wp), parameter :: axes(3, 3) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
      integer :: j

      associate (n => factor%direction, s => averages%compliance)
         select case (factor%word)
         case ('constant')
            value = c(factor%row, factor%column)
         case ('c''')
            value = 0.5_wp*(c(1, 1) - c(1, 2))
         case ('anisotropy_index')
            value = anisotropy_index(c)
         case ('polycrystal_bulk')
            value = averages%bulk
         case ('polycrystal_shear')
            value = averages%shear
         case ('polycrystal_young')
            value = averages%young
         case ('polycrystal_poisson')
            value = averages%poisson
         case ('bulk_modulus')
            value = averages%bulk_reuss
         case ('young')
            value = 1.0_wp/energy(n, n)
         case ('compressibility')
            value = 1000.0_wp*dot_product(sum(s(:3, :), 1), stress(n, n))
         case default
            ! Torsion of a rod along n averages the shear compliance over the directions across n.
            ! The mean follows from the sum over three axes less the term along n.
            value = 0.5_wp/(sum([(energy(n, axes(:, j)), j=1, 3)]) - energy(n, n))
         end select
      end associate

   contains

      !> The symmetric dyad of two vectors as a stress, in Voigt's order.
      pure function stress(a, b)
         real(wp), intent(in) :: a(3), b(3)
         real(wp) :: stress(6)

         stress(:3) = a*b
         stress(4:) = 0.5_wp*[a(2)*b(3) + a(3)*b(2), a(1)*b(3) + a(3)*b(1), a(1)*b(2) + a(2)*b(1)]
      end function stress

      pure real(wp) function energy(a, b)
         real(wp), intent(in) :: a(3), b(3)

         energy = dot_product(stress(a, b), matmul(averages%compliance, stress(a, b)))
      end function energy
   end function value_of
end module quantities
