"""settings_schema.f90 from docs/namelists.md: the types of the settings, and the table of all variables, of which the page is the only list.

A type for each group has a component for each variable, named as the variable; numbers are zero until they are read, and an allocatable component
that is not allocated is unset.
"""

import sys
from pathlib import Path

#: By the second column of the page: kind and number of values in `settings_list`, the procedure that takes the value, its Fortran type.
TEXT, TEXTS, REAL, REALS = "character(len=:), allocatable", "character(len=longest_item), allocatable", "real(wp)", "real(wp), allocatable"
TYPES = {
    "integer": ("kind_integer, shape_one", "integer", "integer"),
    "logical": ("kind_logical, shape_one", "logical", "logical"),
    "real": ("kind_real, shape_one", "real", REAL),
    "real for each constant": ("kind_real, shape_constants", "reals", REALS),
    "list of reals": ("kind_real, shape_list", "reals", REALS),
    "list of texts": ("kind_text, shape_list", "texts", TEXTS),
    "text": ("kind_text, shape_one", "text", TEXT),
    "choice": ("kind_choice, shape_one", "text", TEXT),
    "file": ("kind_file, shape_one", "text", TEXT),
    "choice or file": ("kind_source, shape_one", "text", TEXT),
}
ZERO = {"integer": "0", "logical": ".false.", REAL: "0.0_wp"}

MODULE = """\
!> Made of docs/namelists.md by settings_schema.py.
module settings_schema
   use kinds, only: wp
   use settings_list
   implicit none
   private
   public :: list_settings, set_settings, schema_page

{types}
contains

   !> All groups and variables, in order, with the values of `settings`.
   type(settings_list_type) function list_settings(settings) result(list)
      type(settings_type), intent(in) :: settings
      type(settings_type) :: copy

      allocate (list%groups({n_groups}), list%variables({n_variables}))
{table}
      copy = settings
      call visit_settings(list, copy)
   end function list_settings

   !> Let settings have the values of a list.
   subroutine set_settings(list, settings)
      type(settings_list_type), intent(inout) :: list
      type(settings_type), intent(inout) :: settings

      list%giving = .true.
      call visit_settings(list, settings)
   end subroutine set_settings

   subroutine visit_settings(v, s)
      type(settings_list_type), intent(inout) :: v
      type(settings_type), intent(inout) :: s

      v%n_groups = 0
      v%n_variables = 0
{visits}
   end subroutine visit_settings

   !> The page itself.
   function schema_page() result(page)
      character(len=:), allocatable :: page

      page = ''
{page}
   end function schema_page
end module settings_schema
"""


def text(words: str) -> str:
    """A constant of Fortran, on as many lines as it needs."""
    pieces = [words[i : i + 80].replace("'", "''") for i in range(0, len(words), 80)] or [""]
    return "' &\n         & //'".join(pieces).join("''")


def module(page: str) -> str:
    """The module of a page: groups in its headings, variables in its tables."""
    types, table, visits, group = [], [], [], ""
    lines = page.splitlines()
    for number, line in enumerate(lines):
        if line.startswith("## `&"):
            group = line[5:-1]
            types += [f"   type, public :: {group}_settings_type", "      logical :: given = .false."]
            table += [f"      call list%add_group({text(group)}, {text(lines[number + 2])})"]
            visits += [f"      call v%group(s%{group}%given)"]
        elif line.startswith("| `"):
            name, kind, unit, default, allowed, meaning = line[2:-2].split(" | ")
            kind_and_shape, procedure, declared = TYPES[kind]
            name = name.strip("`")
            optional = default == "unset" and declared in ZERO
            start = "" if optional or declared not in ZERO else f" = {ZERO[declared]}"
            types += [f"      {declared}{', allocatable' * optional} :: {name}{'(:)' * procedure.endswith('s')}{start}"]
            words = ", &\n         & ".join(map(text, (default, allowed, unit, meaning)))
            table += [f"      call list%add({text(name)}, {kind_and_shape}, &\n         & {words})"]
            visits += [f"      call v%{'optional_' * optional}{procedure}(s%{group}%{name})"]
            if not lines[number + 1]:
                types += [f"   end type {group}_settings_type", ""]
    groups = [line[5:-1] for line in lines if line.startswith("## `&")]
    types += ["   type, public :: settings_type", *(f"      type({name}_settings_type) :: {name}" for name in groups), "   end type", ""]
    return MODULE.format(
        types="\n".join(types),
        n_groups=len(groups),
        n_variables=len(table) - len(groups),
        table="\n".join(table),
        visits="\n".join(visits),
        page="\n".join(f"      page = page//{text(line)}//achar(10)" for line in lines[:-1]),
    )


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(module(Path(sys.argv[1]).read_text(encoding="utf-8") + "\n"), encoding="utf-8")
