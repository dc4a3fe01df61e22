!> Diagnostics: what the user must know of a result. The core states a code, a subject and numbers;
!> severity, consequence, sentence and remedy are those of the code in docs/diagnostics.md, of which
!> `diagnostics_rows` is made.
module diagnostics
   use diagnostics_rows, only: code_column, consequence_column, numbers_column, remedy_column, &
      & sentence_column, severity_column
   use json, only: json_type
   use kinds, only: wp
   use text, only: fixed, split_list, to_text
   implicit none
   private
   public :: diagnosed_type, diagnostic_type, diagnostic, is_usable, diagnostics_text

   type :: diagnostic_type
      character(len=:), allocatable :: code
      !> What the diagnostic concerns: a constant, a grain, a file; '' if that is clear.
      character(len=:), allocatable :: subject
      !> In the order of the column `numbers`.
      real(wp), allocatable :: numbers(:)
      !> Row of the code in the page.
      integer, private :: row = 0
   contains
      procedure :: severity, message
      procedure, private :: filled, value_of
   end type diagnostic_type

   !> What has diagnostics.
   type :: diagnosed_type
      type(diagnostic_type), allocatable :: warnings(:)
   contains
      procedure :: warn
   end type diagnosed_type

contains

   !> One diagnostic as a list, which can be appended to others.
   pure function diagnostic(code, subject, numbers) result(list)
      !> Code of the page.
      character(len=*), intent(in) :: code
      !> What it concerns; absent if that is clear.
      character(len=*), intent(in), optional :: subject
      !> In the order of the column `numbers`; absent if there are none.
      real(wp), intent(in), optional :: numbers(:)
      type(diagnostic_type) :: list(1)
      integer :: i

      list(1)%code = code
      list(1)%subject = ''
      if (present(subject)) list(1)%subject = subject
      allocate (list(1)%numbers(0))
      if (present(numbers)) list(1)%numbers = numbers
      ! findloc(code_column, code) is always 0 with gfortran 12.
      list(1)%row = findloc([(code_column(i) == code, i=1, size(code_column))], .true., dim=1)
   end function diagnostic

   !> Add a diagnostic to the warnings: at their end, or, if it makes the result unusable, before
   !> those that do not.
   pure subroutine warn(self, code, subject, numbers)
      class(diagnosed_type), intent(inout) :: self
      !> Code of the page; see `diagnostic`.
      character(len=*), intent(in) :: code
      !> What it concerns; absent if that is clear.
      character(len=*), intent(in), optional :: subject
      !> In the order of the page; absent if there are none.
      real(wp), intent(in), optional :: numbers(:)
      type(diagnostic_type) :: more(1)
      integer :: i, n

      more = diagnostic(code, subject, numbers)
      n = size(self%warnings)
      if (.not. is_usable(more)) n = count([(.not. is_usable(self%warnings(i:i)), i=1, n)])
      self%warnings = [self%warnings(:n), more, self%warnings(n + 1:)]
   end subroutine warn

   !> 'unusable', 'warning' or 'note'.
   pure function severity(self)
      class(diagnostic_type), intent(in) :: self
      character(len=:), allocatable :: severity

      severity = trim(severity_column(self%row))
   end function severity

   !> The sentence and the remedy, in one line.
   pure function message(self) result(line)
      class(diagnostic_type), intent(in) :: self
      character(len=:), allocatable :: line, remedy

      line = self%filled(sentence_column(self%row))
      remedy = self%filled(remedy_column(self%row))
      if (len(remedy) > 0) line = line//'. '//remedy
   end function message

   !> A text of the page with the subject and the numbers in their places.
   pure function filled(self, template) result(text)
      class(diagnostic_type), intent(in) :: self
      !> A cell of the column `sentence` or `remedy`.
      character(len=*), intent(in) :: template
      character(len=:), allocatable :: text, rest
      integer :: first, last

      text = ''
      rest = trim(template)
      do
         first = index(rest, '{')
         if (first == 0) exit
         last = index(rest, '}')
         text = text//rest(:first - 1)//self%value_of(rest(first + 1:last - 1))
         rest = rest(last + 1:)
      end do
      text = text//rest
   end function filled

   !> The text of a place: 'subject', 'NAME:.2f' (two decimals) or 'NAME:.2g' (two digits).
   pure function value_of(self, place) result(text)
      class(diagnostic_type), intent(in) :: self
      character(len=*), intent(in) :: place
      character(len=:), allocatable :: text
      integer :: colon, number, digits

      text = self%subject
      colon = index(place, ':')
      if (colon == 0) return
      associate (names => split_list(trim(numbers_column(self%row))))
         number = findloc(names == place(:colon - 1), .true., dim=1)
      end associate
      digits = iachar(place(colon + 2:colon + 2)) - iachar('0')
      if (place(len(place):) == 'f') then
         text = fixed(self%numbers(number), digits)
      else
         text = to_text(self%numbers(number), digits)
         if (scan(text, '.', back=.true.) == len(text)) text = text(:len(text) - 1)
      end if
   end function value_of

   !> Whether no diagnostic says that the result cannot be used.
   pure logical function is_usable(list)
      type(diagnostic_type), intent(in) :: list(:)
      integer :: i

      is_usable = all([(list(i)%severity() /= 'unusable', i=1, size(list))])
   end function is_usable

   !> Diagnostics as a JSON array.
   function diagnostics_text(list) result(text)
      type(diagnostic_type), intent(in) :: list(:)
      character(len=:), allocatable :: text
      type(json_type) :: page
      integer :: i

      call page%begin_array('')
      do i = 1, size(list)
         associate (row => list(i)%row)
            call page%begin_object('')
            call page%put('code', list(i)%code)
            call page%put('severity', trim(severity_column(row)))
            call page%put('consequence', trim(consequence_column(row)))
            call page%put('subject', list(i)%subject)
            call page%put_numbers(trim(numbers_column(row)), list(i)%numbers, 'numbers')
            call page%put('text', list(i)%filled(sentence_column(row)))
            call page%put('remedy', list(i)%filled(remedy_column(row)))
            call page%end_object()
         end associate
      end do
      call page%end_array()
      text = page%text()
      ! Without the newline at its end.
      text = text(:len(text) - 1)
   end function diagnostics_text
end module diagnostics
