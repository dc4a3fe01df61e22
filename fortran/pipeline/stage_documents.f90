!> What results follow from, so that results of other inputs are never taken for those of the present ones.
!>
!> A document carries a digest of every input that it was made from: groups of the namelist with the tables that they name, and the
!> surrogate. The manifest of the output folder (inputs.json) has the digests of the inputs last used there. A document belongs to them if
!> all that both name are the same. Every document ends with a checksum of all before it.
module stage_documents
   use checksums, only: checksum
   use errors, only: error_type, refuse
   use files, only: file_exists, full_path, read_bytes, replace_file
   use json, only: quoted
   use point_tables, only: points_type
   use problem, only: problem_type
   use settings_output, only: settings_namelist
   use surrogate_lookup, only: find_surrogate, places_type
   use text, only: newline, split_list
   implicit none
   private
   public :: begin_results, digest_surrogate, inputs_of, keep_document, write_document, read_document, read_resolved

   character(len=*), parameter :: manifest_name = '/inputs.json', resolved_name = '/resolved.nml'
   !> With what a document ends, and what is between it and its checksum.
   character(len=*), parameter :: tail = newline//'}'//newline
   character(len=*), parameter :: seal = ','//newline//' "checksum": "text:'

contains

   !> Keep the resolved namelist in a folder, and let these be the inputs last used there; those of other groups stay.
   subroutine begin_results(problem, groups, places, error)
      type(problem_type), intent(in) :: problem
      !> Of the namelist, separated by blanks.
      character(len=*), intent(in) :: groups
      !> The folder of the results among them.
      type(places_type), intent(in) :: places
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: manifest, inputs, resolved, output, entries(:)
      integer :: at, i

      output = places%output(:len(places%output) - 1)
      inputs = inputs_of(problem, groups, places)
      manifest = ''
      if (file_exists(output//manifest_name)) call read_document(output//manifest_name, manifest, error)
      if (allocated(error)) return
      at = index(manifest, '"inputs": {') + len('"inputs": {')
      ! '"name": "digest"' each.
      entries = split_list(manifest(at:at + index(manifest(at:), '}') - 2))
      do i = 1, size(entries)
         if (index(inputs, entries(i)(:index(entries(i), ':'))) == 0) inputs = inputs//', '//trim(entries(i))
      end do
      resolved = problem%resolved_text()
      call write_document(output//manifest_name, '{'//newline//' "namelist": '//quoted(full_path(problem%path))//','//newline &
         & //' "resolved": "'//checksum(resolved)//'",'//newline//' "inputs": {'//inputs//'}'//newline//'}'//newline, error)
      if (.not. allocated(error)) call replace_file(output//resolved_name, resolved, error)
   end subroutine begin_results

   !> The namelist of a folder `output`, `resolved`, '' where there is none; refused if the manifest is about another.
   subroutine read_resolved(output, resolved, error)
      character(len=*), intent(in) :: output
      character(len=:), allocatable, intent(out) :: resolved
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: manifest

      resolved = ''
      manifest = ''
      if (file_exists(output//resolved_name)) call read_bytes(output//resolved_name, resolved, error)
      if (file_exists(output//manifest_name) .and. .not. allocated(error)) then
         call read_document(output//manifest_name, manifest, error)
      end if
      if (allocated(error) .or. index(manifest, '"resolved"') == 0) return
      if (index(manifest, checksum(resolved)) == 0) call refuse(error, output//resolved_name//': is not what the results beside ' &
         & //'it came from: another run replaced it, or it is damaged; run again')
   end subroutine read_resolved

   !> Keep a document, and the inputs that it follows from.
   subroutine keep_document(problem, groups, places, name, document, error)
      type(problem_type), intent(in) :: problem
      !> As in `begin_results`.
      character(len=*), intent(in) :: groups
      type(places_type), intent(in) :: places
      !> Of the file.
      character(len=*), intent(in) :: name
      !> JSON, an object that is not empty; the inputs are added.
      character(len=:), allocatable, intent(inout) :: document
      type(error_type), allocatable, intent(out) :: error

      document = document(:len(document) - len(tail))//','//newline//' "inputs": {'//inputs_of(problem, groups, places)//'}'//tail
      call begin_results(problem, groups, places, error)
      if (.not. allocated(error)) call write_document(places%output//name, document, error)
   end subroutine keep_document

   !> Write a document with a checksum as its last entry.
   subroutine write_document(path, document, error)
      !> Of the file; JSON, an object that is not empty.
      character(len=*), intent(in) :: path, document
      type(error_type), allocatable, intent(out) :: error

      associate (body => document(:len(document) - len(tail)))
         call replace_file(path, body//seal//checksum(body)//'"'//tail, error)
      end associate
   end subroutine write_document

   !> The document of a file without its checksum; one that was changed is refused.
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
         call refuse(error, path//': is damaged, or is no JSON document (it was changed since it was written); remove it, and ' &
            & //'run the command again')
      end if
   end subroutine read_document

   !> Digest of the surrogate of this name, of all but where it comes from: its namelist may ask for more, or have another title.
   subroutine digest_surrogate(name, places, digest, error)
      character(len=*), intent(in) :: name
      type(places_type), intent(in) :: places
      character(len=:), allocatable, intent(out) :: digest
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path, content

      call find_surrogate(name, places, path, error)
      content = ''
      if (len(path) > 0 .and. .not. allocated(error)) call read_bytes(path, content, error)
      if (.not. allocated(error)) digest = checksum(content(:index(content//newline//'provenance ', newline//'provenance ') - 1))
   end subroutine digest_surrogate

   !> Digests of groups of a problem, with the tables and the surrogate that they name: '"name": "digest"', separated by ', '.
   recursive function inputs_of(problem, groups, places) result(inputs)
      type(problem_type), intent(in) :: problem
      !> As in `begin_results`.
      character(len=*), intent(in) :: groups
      type(places_type), intent(in) :: places
      character(len=:), allocatable :: inputs
      character(len=:), allocatable :: left, group, page, content, digest
      type(error_type), allocatable :: missing

      inputs = ''
      page = settings_namelist(problem%settings, groups)
      left = groups//' '
      do while (len(left) > 0)
         group = left(:index(left, ' ') - 1)
         left = left(len(group) + 2:)
         ! No result follows from the machine.
         if (len(group) == 0 .or. group == 'execution' .or. index(inputs, '"'//group//'"') > 0) cycle
         content = page(index(page, newline//'&'//group//newline):)
         content = content(:index(content, newline//'/'))
         select case (group)
         case ('problem')
            content = content(:index(content, '  title = '))//content(index(content, '  synthetic'):)
         case ('crystals')
            call add_table(problem%crystals)
         case ('curves')
            if (allocated(problem%curves)) content = content//problem%curves%digest//problem%curves%tests%digest()
         case ('references')
            call add_table(problem%references)
         case ('measurements')
            if (problem%settings%curves%given .and. .not. allocated(problem%settings%measurements%file)) then
               ! They follow from the curves.
               content = content//inputs_of(problem, 'curves references', places)
            else
               call add_table(problem%measurements)
               if (allocated(problem%shared_digest)) content = content//problem%shared_digest
            end if
         case ('design')
            call add_table(problem%candidates)
         case ('next')
            call add_table(problem%grains)
         case ('knowledge')
            if (allocated(problem%stiffness)) content = content//problem%stiffness%table%digest()
         case default
            ! There is no table.
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
end module stage_documents
