!> Columns of tables: their names, and the numbers that they may have.
module table_columns
   use direction_columns, only: ways
   use errors, only: error_type, refuse, suggestion
   use kinds, only: nan, wp
   use observables, only: modulus_kinds
   use tables, only: longest_name, table_type
   use text, only: join, split_list, to_text
   implicit none
   private
   public :: column_type, angle_columns, find_column, read_column, read_numbers, find_modulus, &
      & foreign_column

   type :: column_type
      character(len=longest_name) :: name
      !> Least and greatest number; the unit, after a blank, and the words that follow a number
      !> which is not allowed.
      real(wp) :: allowed(2) = [-huge(1.0_wp), huge(1.0_wp)]
      character(len=8) :: unit = ''
      character(len=60) :: refusal = ''
   end type column_type
   !> Moduli of metals, GPa; depths and sizes of grains, um; speeds of surface waves, m/s;
   !> directions, degrees.
   real(wp), parameter :: moduli(2) = [1.0_wp, 2000.0_wp], lengths(2) = [1.0e-6_wp, 1.0e6_wp], &
      & speeds(2) = [100.0_wp, 30000.0_wp], turns(2) = [-360.0_wp, 360.0_wp], no_less = tiny(1.0_wp)
   real(wp), parameter :: many_turns(2) = 100.0_wp*turns, half_turn(2) = [0.0_wp, 180.0_wp]
   character(len=*), parameter :: no_modulus = ' is no modulus of a metal', &
      & no_speed = ' is no speed of a wave'
   type(column_type), parameter :: modulus_columns(4) = [ &
      & column_type('modulus_gpa', moduli, ' GPa', no_modulus), &
      & column_type('indentation_modulus_gpa', moduli, ' GPa', no_modulus), &
      & column_type('effective_modulus_gpa', moduli, ' GPa', no_modulus), &
      & column_type('sample_modulus_gpa', moduli, ' GPa', no_modulus)]
   type(column_type), parameter :: grain_columns(9) = [ &
      & column_type('sd_gpa', [no_less, moduli(2)], ' GPa', &
      & '; a standard deviation is above 0, up to 2000.0 GPa'), &
      & column_type('orientation_sd_deg', [0.0_wp, 20.0_wp], ' degrees'), &
      & column_type('depth_um', lengths, ' um'), column_type('contact_radius_um', lengths, ' um'), &
      & column_type('thickness_um', lengths, ' um'), &
      & column_type('zero_sd_nm', [0.0_wp, 1000.0_wp], ' nm'), &
      & column_type('grain_radius_um', lengths, ' um'), &
      & column_type('sample_nu', [-0.999_wp, 0.5_wp]), column_type('row')]
   type(column_type), parameter :: propagation_column = column_type('propagation_deg', turns, &
      & ' degrees')
   type(column_type), parameter :: speed_columns(3) = [ &
      & column_type('rayleigh_velocity_m_s', speeds, ' m/s', no_speed), &
      & column_type('velocity_m_s', speeds, ' m/s', no_speed), &
      & column_type('sd_m_s', [no_less, speeds(2)], ' m/s', &
      & '; a standard deviation is above 0, up to 30000.0 m/s')]
   type(column_type), parameter :: angle_columns(3) = [ &
      & column_type('phi1_deg', many_turns, ' degrees', '; allowed -36000.0 to 36000.0'), &
      & column_type('Phi_deg', half_turn, ' degrees', '; allowed 0.0 to 180.0'), &
      & column_type('phi2_deg', many_turns, ' degrees', '; allowed -36000.0 to 36000.0')]
   type(column_type), parameter :: drift_column = column_type('drift_nm_s', [-5.0_wp, 5.0_wp], &
      & ' nm/s', ' is no drift of an instrument')
   type(column_type), parameter :: known_columns(*) = [modulus_columns, grain_columns, &
      & propagation_column, speed_columns, angle_columns, drift_column]
   !> Further columns of a canonical table of measurements.
   character(len=*), parameter :: further = 'grain, test, x_um, y_um, group, reference, ' &
      & //'session, time_s'

contains

   !> Find the `column` of a name that the table must have. Nothing is done after an error.
   subroutine find_column(table, name, column, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      integer, intent(out) :: column
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: names

      column = table%find(name)
      if (column > 0 .or. allocated(error)) return
      names = table%names()
      call refuse(error, 'the column '//name//' is missing; the columns are '//names &
         & //suggestion(name, names))
   end subroutine find_column

   !> Read the `values` of one of `known_columns`. An `optional` column may be absent and may have
   !> empty cells, which give NaN. Nothing is done after an error.
   subroutine read_column(table, name, optional, values, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      logical, intent(in) :: optional
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(inout) :: error
      integer :: column

      column = table%find(name)
      if (.not. optional) call find_column(table, name, column, error)
      call read_numbers(table, column, known_columns(findloc(known_columns%name, name, 1)), &
         & optional, values, error)
   end subroutine read_column

   !> Read the `values` of a `column`. They are NaN if the column is 0, and in empty cells, if these
   !> are allowed by `may_be_empty`. Nothing is done after an error.
   subroutine read_numbers(table, column, known, may_be_empty, values, error)
      type(table_type), intent(in) :: table
      integer, intent(in) :: column
      !> The numbers that it may have. The range is added to a refusal without a semicolon.
      type(column_type), intent(in) :: known
      logical, intent(in) :: may_be_empty
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: words
      integer :: i

      allocate (values(table%rows), source=nan)
      do i = 1, merge(table%rows, 0, column > 0)
         if (may_be_empty .and. table%is_empty(column, i)) cycle
         call table%number(column, i, values(i), error)
         if (allocated(error)) return
         associate (least => known%allowed(1), most => known%allowed(2))
            if (values(i) >= least .and. values(i) <= most) cycle
            words = trim(known%refusal)
            if (index(words, ';') == 0) then
               if (known%unit == ' GPa' .and. values(i) > most) words = ' looks like MPa'
               words = words//'; allowed '//to_text(least)//' to '//to_text(most)//trim(known%unit)
            end if
         end associate
         call table%refuse(column, i, trim(known%unit)//words, error)
         return
      end do
   end subroutine read_numbers

   !> Find the column of the moduli, and their kind, from its name or as it is stated.
   subroutine find_modulus(table, stated, name, kind, error)
      type(table_type), intent(in) :: table
      !> A kind of modulus, or unallocated.
      character(len=:), allocatable, intent(in) :: stated
      character(len=:), allocatable, intent(out) :: name, kind
      type(error_type), allocatable, intent(out) :: error
      character(len=longest_name), allocatable :: found(:)
      character(len=:), allocatable :: choices
      integer :: i

      choices = ''''//join(modulus_kinds, ''', ''')//''''
      found = pack(modulus_columns%name, &
         & [(table%find(trim(modulus_columns(i)%name)) > 0, i=1, size(modulus_columns))])
      if (size(found) /= 1) then
         call refuse(error, trim(merge('no column is a modulus       ', &
            & 'several columns are a modulus', size(found) == 0))//'; allowed ' &
            & //join(modulus_kinds, '_gpa, ')//'_gpa, or modulus_gpa with modulus_kind; ' &
            & //'the columns are '//table%names())
         return
      end if
      name = trim(found(1))
      kind = name(:index(name, '_gpa') - 1)
      if (kind == 'modulus' .and. .not. allocated(stated)) then
         call refuse(error, 'the column modulus_gpa does not say which modulus was measured, nor ' &
            & //'does modulus_kind; allowed '//choices//' (effective_modulus: reduced modulus, ' &
            & //'Er; sample_modulus: EIT, Young''s modulus)')
         return
      end if
      if (.not. allocated(stated)) return
      if (kind /= 'modulus' .and. kind /= stated) then
         call refuse(error, 'modulus_kind = '''//stated//''', but the moduli are those of the ' &
            & //'column '//name//'; leave modulus_kind out, or name the column modulus_gpa')
      end if
      kind = stated
   end subroutine find_modulus

   !> Number of the first column that no canonical table of measurements has; 0 if there is none.
   pure integer function foreign_column(table) result(column)
      type(table_type), intent(in) :: table
      character(len=:), allocatable :: names(:), name

      allocate (names, source=split_list(join(known_columns%name, ', ')//', '//further//', ' &
         & //join(ways(:3), ', ')))
      do column = 1, table%columns
         name = table%name(column)
         if (len(name) > 0 .and. all(names /= name) .and. index(name, 'shared_') /= 1) return
      end do
      column = 0
   end function foreign_column

end module table_columns
