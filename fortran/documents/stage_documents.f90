!> Documents of the stages, with digests of their inputs, so that results of other inputs are not
!> confused with those of the present ones.
!>
!> A document has a digest of every input: the groups of the namelist with the tables that they
!> name, and the surrogate. The manifest of the output folder (inputs.json) has the digests of the
!> inputs last used there. A document belongs to these inputs if all digests that both have are
!> equal. Every document ends with a checksum.
!>
!> The module also writes the tables of moduli of `simulate` and `theory`, and their crystals.
module stage_documents
   use diagnostics, only: diagnostic_type, diagnostics_text
   use errors, only: error_type, refuse
   use files, only: checksum, file_exists, full_path, read_bytes, replace_file
   use json, only: json_type, quoted
   use kinds, only: wp
   use observables, only: modulus_kinds, new_observable, observable_type
   use point_tables, only: points_type
   use problem, only: canonical_mark, problem_type, table_name
   use resolved_namelist, only: resolved_text
   use settings_reader, only: settings_namelist
   use surrogate_model, only: find_surrogate, places_type
   use tables, only: write_table
   use text, only: join, newline, short_text, split_list
   implicit none
   private
   public :: begin_results, write_canonical, digest_surrogate, inputs_of, end_document, &
      & write_document, read_document, read_resolved, write_moduli, cells_of_numbers, begin_crystal

   character(len=*), parameter :: manifest_name = '/inputs.json', resolved_name = '/resolved.nml'
   !> The end of a document, and the text between the document and its checksum.
   character(len=*), parameter :: tail = newline//'}'//newline, &
      & seal = ','//newline//' "checksum": "text:'

contains

   !> Write the resolved namelist into the folder of the results, and the digests of these groups
   !> into its manifest. Digests of other groups stay there.
   subroutine begin_results(problem, groups, places, error)
      type(problem_type), intent(in) :: problem
      !> Groups of the namelist, separated by blanks.
      character(len=*), intent(in) :: groups
      !> Has the folder of the results.
      type(places_type), intent(in) :: places
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: manifest, inputs, resolved, output, entries(:)
      character(len=*), parameter :: key = '"inputs": {'
      integer :: at, i

      output = places%output(:len(places%output) - 1)
      inputs = inputs_of(problem, groups, places)
      manifest = ''
      if (file_exists(output//manifest_name)) then
         call read_document(output//manifest_name, manifest, error)
      end if
      if (allocated(error)) return
      at = index(manifest, key)
      at = merge(at + len(key), len(manifest) + 1, at > 0)
      ! Each entry is '"name": "digest"'.
      entries = split_list(manifest(at:at + index(manifest(at:), '}') - 2))
      do i = 1, size(entries)
         if (index(inputs, entries(i)(:index(entries(i), ':'))) == 0) then
            inputs = inputs//', '//trim(entries(i))
         end if
      end do
      if (allocated(problem%data%table_text)) then
         call write_canonical(output//'/'//table_name, problem%data%table_text, error)
         if (allocated(error)) return
      end if
      resolved = resolved_text(problem)
      call write_document(output//manifest_name, '{'//newline//' "namelist": ' &
         & //quoted(full_path(problem%run%path))//','//newline//' "resolved": "' &
         & //checksum(resolved)//'",'//newline//' "inputs": {'//inputs//'}'//newline//'}' &
         & //newline, error)
      if (allocated(error)) return
      call replace_file(output//resolved_name, resolved, error)
   end subroutine begin_results

   !> Write a canonical table, which begins with the mark of this program. Other files are not
   !> replaced.
   subroutine write_canonical(path, page, error)
      character(len=*), intent(in) :: path
      !> CSV.
      character(len=*), intent(in) :: page
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: present, marked

      marked = page
      if (index(page, canonical_mark) /= 1) marked = canonical_mark//newline//page
      if (file_exists(path)) then
         call read_bytes(path, present, error)
         if (allocated(error)) return
         if (present == page .or. present == marked) return
         if (index(present, canonical_mark) /= 1) then
            call refuse(error, path//': is a file that this program did not write, and is not ' &
               & //'replaced; move it, or state another folder with --output')
            return
         end if
      end if
      call replace_file(path, marked, error)
   end subroutine write_canonical

   !> Read the resolved namelist of the folder `output`, '' if there is none. It is refused if the
   !> manifest is of another one.
   subroutine read_resolved(output, resolved, error)
      character(len=*), intent(in) :: output
      character(len=:), allocatable, intent(out) :: resolved
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: manifest

      resolved = ''
      manifest = ''
      if (file_exists(output//resolved_name)) then
         call read_bytes(output//resolved_name, resolved, error)
      end if
      if (file_exists(output//manifest_name) .and. .not. allocated(error)) then
         call read_document(output//manifest_name, manifest, error)
      end if
      if (allocated(error) .or. index(manifest, '"resolved"') == 0) return
      if (index(manifest, checksum(resolved)) == 0) then
         call refuse(error, output//resolved_name//': is not what the results beside it came ' &
            & //'from: another run replaced it, or it is damaged; run again')
      end if
   end subroutine read_resolved

   !> Close the document of a `page` with the warnings.
   function end_document(page, warnings) result(document)
      type(json_type), intent(in) :: page
      type(diagnostic_type), intent(in) :: warnings(:)
      character(len=:), allocatable :: document
      type(json_type) :: whole

      whole = page
      call whole%put_json('warnings', diagnostics_text(warnings))
      call whole%end_object()
      document = whole%text()
   end function end_document

   !> Write a document with a checksum as its last entry.
   subroutine write_document(path, document, error)
      !> Path of the file; a JSON object that is not empty.
      character(len=*), intent(in) :: path, document
      type(error_type), allocatable, intent(out) :: error

      associate (body => document(:len(document) - len(tail)))
         call replace_file(path, body//seal//checksum(body)//'"'//tail, error)
      end associate
   end subroutine write_document

   !> Read a document without its checksum. A document that was changed is refused.
   subroutine read_document(path, document, error)
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      integer :: at

      call read_bytes(path, document, error)
      if (allocated(error)) return
      at = index(document, seal, back=.true.)
      if (at > 0 .and. document(max(1, at):) == seal//checksum(document(:at - 1))//'"'//tail) then
         document = document(:at - 1)//tail
      else
         call refuse(error, path//': is damaged, or is no JSON document (it was changed since it ' &
            & //'was written); remove it, and run the command again')
      end if
   end subroutine read_document

   !> Compute the digest of a surrogate without its provenance, whose namelist may have another
   !> title or ask for more.
   subroutine digest_surrogate(name, places, digest, error)
      character(len=*), intent(in) :: name
      type(places_type), intent(in) :: places
      character(len=:), allocatable, intent(out) :: digest
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path, content

      call find_surrogate(name, places, path, error)
      content = ''
      if (len(path) > 0 .and. .not. allocated(error)) call read_bytes(path, content, error)
      if (allocated(error)) return
      digest = &
         & checksum(content(:index(content//newline//'provenance ', newline//'provenance ') - 1))
   end subroutine digest_surrogate

   !> Digests of groups of a problem, with the tables and the surrogate that they name, as '"name":
   !> "digest"', separated by ', '.
   recursive function inputs_of(problem, groups, places) result(inputs)
      type(problem_type), intent(in) :: problem
      !> As in `begin_results`.
      character(len=*), intent(in) :: groups
      type(places_type), intent(in) :: places
      character(len=:), allocatable :: inputs, group, page, content, digest
      type(error_type), allocatable :: missing

      inputs = ''
      page = settings_namelist(problem%settings, groups)
      do while (len(page) > 0)
         ! A group is an empty line, a line with its name, its variables, and a slash.
         group = page(3:index(page(2:), newline))
         content = page(:index(page, newline//'/'))
         page = page(len(content) + 3:)
         select case (group)
         case ('execution')
            ! Results do not depend on the machine.
            cycle
         case ('problem')
            content = content(:index(content, '  title = ')) &
               & //content(index(content, '  synthetic'):)
         case ('knowledge')
            ! Leave out its last variable, which has one of two forms.
            content = content(:index(content, newline//'  source =') + index(content, &
               & newline//'  ! source'))
            if (allocated(problem%data%stiffness)) then
               content = content//problem%data%stiffness%table%digest()
            end if
         case ('sampler')
            ! Results do not depend on its last variable, which says what is written.
            content = content(:index(content, newline//'  draws ='))
         case ('surrogate')
            ! The correction of a film follows from these.
            if (problem%settings%specimen%geometry == 'film') then
               content = content//inputs_of(problem, 'specimen simulation', places)
            end if
         case ('specimen')
            if (allocated(problem%data%layers)) then
               content = content//problem%data%layers%table%digest()
            end if
         case ('crystals')
            call add_table(problem%data%crystals)
         case ('curves')
            if (.not. problem%settings%curves%given) cycle
            if (allocated(problem%data%curves)) then
               content = content//problem%data%curves%digest//problem%data%curves%tests%digest()
            end if
         case ('references')
            if (.not. problem%settings%curves%given) cycle
            call add_table(problem%data%references)
         case ('measurements')
            if (problem%settings%curves%given &
               & .and. .not. allocated(problem%settings%measurements%file)) then
               ! The measurements follow from the curves.
               content = content//inputs_of(problem, 'curves references', places)
            else
               call add_table(problem%data%measurements)
               if (allocated(problem%data%shared_digest)) then
                  content = content//problem%data%shared_digest
               end if
            end if
            call add_table(problem%data%velocities)
            if (allocated(problem%settings%measurements%texture)) then
               call add_table(problem%data%texture)
            end if
         case ('plan')
            if (.not. problem%settings%plan%given) cycle
         case ('design')
            call add_table(problem%data%candidates)
         case ('next')
            call add_table(problem%data%grains)
         case default
            ! The other groups name no files of their own.
         end select
         inputs = inputs//', "'//group//'": "'//checksum(content)//'"'
      end do
      if (index(' '//groups//' ', ' surrogate ') > 0) then
         call digest_surrogate(problem%settings%surrogate%file, places, digest, missing)
         if (.not. allocated(missing)) inputs = inputs//', "surrogate_file": "'//digest//'"'
      end if
      inputs = inputs(3:)

   contains

      subroutine add_table(points)
         type(points_type), allocatable, intent(in) :: points

         if (allocated(points)) content = content//points%table%digest()
      end subroutine add_table
   end function inputs_of

   !> Write the user's table of the crystals with every kind of modulus, GPa, and with the
   !> velocities. The cell of NaN is empty.
   subroutine write_moduli(problem, path, modulus, error, velocity)
      type(problem_type), intent(in) :: problem
      character(len=*), intent(in) :: path
      !> Indentation moduli, GPa; NaN after a failure.
      real(wp), intent(in) :: modulus(:)
      type(error_type), allocatable, intent(out) :: error
      !> Of surface waves, m/s.
      real(wp), intent(in), optional :: velocity(:)
      character(len=:), allocatable :: names
      type(observable_type) :: observable
      real(wp), allocatable :: moduli(:, :)
      integer :: j

      allocate (moduli(size(modulus), size(modulus_kinds)))
      names = ''
      do j = 1, size(modulus_kinds)
         call new_observable(trim(modulus_kinds(j)), problem%settings%measurements, observable, &
            & error)
         if (allocated(error)) return
         names = names//','//trim(modulus_kinds(j))//'_gpa'
         moduli(:, j) = modulus
         call observable%to_measured(moduli(:, j))
      end do
      if (present(velocity)) then
         names = names//',rayleigh_velocity_m_s'
         moduli = reshape([moduli, velocity], [size(modulus), size(modulus_kinds) + 1])
      end if
      call write_table(problem%data%crystals%table, path, names, moduli, error)
   end subroutine write_moduli

   !> Cells of `values` after other cells, and the end of their line.
   pure function cells_of_numbers(values) result(line)
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: line
      integer :: j

      line = ''
      do j = 1, size(values)
         line = line//','//short_text(values(j))
      end do
      line = line//newline
   end function cells_of_numbers

   !> Begin the object of the crystal of a `row`: its constants by name, GPa, and its angles,
   !> degrees.
   subroutine begin_crystal(page, points, row)
      type(json_type), intent(inout) :: page
      type(points_type), intent(in) :: points
      integer, intent(in) :: row

      call page%begin_object('')
      associate (names => points%classes(points%class(row))%constants)
         call page%put_numbers(join(names, ', '), points%constants(:size(names), row), 'constants')
      end associate
      call page%put('euler_deg', points%euler_deg(:, row))
   end subroutine begin_crystal
end module stage_documents
