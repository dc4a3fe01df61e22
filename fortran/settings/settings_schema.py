"""settings_schema.f90 from docs/namelists.md: the types of the settings, and the table of all
variables, of which the page is the only list.

A type for each group has a component for each variable, named as the variable; numbers are zero
until they are read, and an allocatable component that is not allocated is unset.
"""

import re
import sys
from pathlib import Path

from page_rows import text

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
#: The Fortran type of one value of a kind, and of several; other kinds are texts.
TYPES = {"integer": "integer", "logical": "logical", "real": REAL}
LIST_TYPES = {"real": REALS, "text": TEXTS}

MODULE = """\
!> Made of docs/namelists.md by settings_schema.py.
module settings_schema
   use kinds, only: wp
   use settings_list
   use text, only: to_text
   implicit none
   private
   public :: list_settings, set_settings

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
end module settings_schema
"""


def module(page: str) -> str:
    """The module of a page: groups in its headings, variables in its tables."""
    types, table, taken, given, groups, n = [], [], [], [], [], 0
    for section in page.split("\n## `&")[1:]:
        heading, _, group_meaning, *lines = section.splitlines()
        group = heading.strip("`")
        groups += [group]
        place = len(groups)
        types += [f"   type, public :: {group}_settings_type", "      logical :: given = .false."]
        table += [f"      list%groups({place})%name = {text(group)}"]
        taken += [f"         g({place})%given = s%{group}%given"]
        given += [f"         s%{group}%given = g({place})%given"]
        for line in (line for line in lines if line.startswith("| `")):
            name, words, unit, default, allowed, meaning = line[2:-2].split(" | ")
            n, name = n + 1, name.strip("`")
            kind = re.sub("list of | for each constant|s$", "", words)
            shape = "constants" if words.endswith(" constant") else "one"
            shape = "list" if words.startswith("list") else shape
            declared = TYPES.get(kind, TEXT) if shape == "one" else LIST_TYPES[kind]
            start, texts, value = COMPONENTS[declared]
            if default == "unset" and start.startswith(" ="):
                declared, start = f"{declared}, allocatable", ""
            types += [f"      {declared} :: {name}{start}"]
            facts = (group, group_meaning, name, kind, shape, unit, default, allowed, meaning)
            table += [
                f"      list%variables({n}) = variable_type( &\n         & "
                + ", &\n         & ".join(map(text, facts))
                + ")"
            ]
            component, values = f"s%{group}%{name}", f"v({n})%values"
            known = f"if (allocated({component})) " if "allocatable" in declared else ""
            taken += [f"         {known}{values} = {texts.format(component)}"]
            given += [f"         if (allocated({values})) {component} = {value.format(values)}"]
        types += [f"   end type {group}_settings_type", ""]
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
    )


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(
        module(Path(sys.argv[1]).read_text(encoding="utf-8")), encoding="utf-8"
    )
