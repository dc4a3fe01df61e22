"""settings_schema.f90 from docs/namelists.md: the types of the settings, and the table of all
variables, of which the page is the only list.

A type for each group has a component for each variable, named as the variable; numbers are zero
until they are read, and an allocatable component that is not allocated is unset.
"""

import sys
from pathlib import Path

TEXT, TEXTS, REAL, REALS = (
    "character(len=:), allocatable",
    "character(len=longest_item), allocatable",
    "real(wp)",
    "real(wp), allocatable",
)
#: What a component of each Fortran type is until it is read; its values as texts; and it from
#: these.
COMPONENTS = {
    "integer": (" = 0", "text_values([to_text({})])", "nint(real_of({}(1)))"),
    "logical": (" = .false.", "text_values([to_text({})])", "{}(1)%text == '.true.'"),
    REAL: (" = 0.0_wp", "real_values([{}])", "real_of({}(1))"),
    REALS: ("(:)", "real_values({})", "real_of({})"),
    TEXTS: ("(:)", "text_values({})", "name_of({})"),
    TEXT: ("", "text_values([{}])", "{}(1)%text"),
}
#: The Fortran type by the second column of the page.
TYPES = {
    "integer": "integer",
    "logical": "logical",
    "real": REAL,
    "list of texts": TEXTS,
    **dict.fromkeys(("real for each constant", "list of reals"), REALS),
    **dict.fromkeys(("text", "choice", "file", "choice or file"), TEXT),
}

MODULE = """\
!> Made of docs/namelists.md by settings_schema.py.
module settings_schema
   use kinds, only: wp
   use settings_list
   use text, only: to_text
   implicit none
   private
   public :: list_settings, set_settings, schema_page

{types}
contains

   !> All groups and variables, in order, with the values of `settings`.
   type(settings_list_type) function list_settings(settings) result(list)
      type(settings_type), intent(in) :: settings

      allocate (list%groups({n_groups}), list%variables({n_variables}))
{table}
      associate (s => settings, g => list%groups, v => list%variables)
{taken}
      end associate
   end function list_settings

   !> Let settings that are new have the values of a list.
   subroutine set_settings(list, settings)
      type(settings_list_type), intent(in) :: list
      type(settings_type), intent(inout) :: settings

      associate (s => settings, g => list%groups, v => list%variables)
{given}
      end associate
   end subroutine set_settings

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
    types, table, taken, given, group, n = [], [], [], [], "", 0
    lines = page.splitlines()
    for number, line in enumerate(lines):
        if line.startswith("## `&"):
            group = line[5:-1]
            types += [
                f"   type, public :: {group}_settings_type",
                "      logical :: given = .false.",
            ]
            place = len(table) - n + 1
            table += [f"      list%groups({place})%name = {text(group)}"]
            taken += [f"         g({place})%given = s%{group}%given"]
            given += [f"         s%{group}%given = g({place})%given"]
        elif line.startswith("| `"):
            name, kind, unit, default, allowed, meaning = line[2:-2].split(" | ")
            n, name, declared = n + 1, name.strip("`"), TYPES[kind]
            start, texts, value = COMPONENTS[declared]
            if default == "unset" and start.startswith(" ="):
                declared, start = f"{declared}, allocatable", ""
            types += [f"      {declared} :: {name}{start}"]
            words = ", &\n         & ".join(map(text, (default, allowed, unit, meaning)))
            table += [
                f"      list%variables({n}) = new_variable({text(group)}, {text(name)}, "
                f"{text(kind)}, &\n         & {words})"
            ]
            component, values = f"s%{group}%{name}", f"v({n})%values"
            known = f"if (allocated({component})) " if "allocatable" in declared else ""
            taken += [f"         {known}{values} = {texts.format(component)}"]
            given += [f"         if (allocated({values})) {component} = {value.format(values)}"]
            if not lines[number + 1]:
                types += [f"   end type {group}_settings_type", ""]
    groups = [line[5:-1] for line in lines if line.startswith("## `&")]
    types += [
        "   type, public :: settings_type",
        *(f"      type({name}_settings_type) :: {name}" for name in groups),
        "   end type",
        "",
    ]
    return MODULE.format(
        types="\n".join(types),
        n_groups=len(groups),
        n_variables=n,
        table="\n".join(table),
        taken="\n".join(taken),
        given="\n".join(given),
        page="\n".join(f"      page = page//{text(line)}//achar(10)" for line in lines[:-1]),
    )


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(
        module(Path(sys.argv[1]).read_text(encoding="utf-8") + "\n"), encoding="utf-8"
    )
