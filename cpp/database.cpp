// SQLite databases: statements with parameters, and the cells of their results. A C interface for
// Fortran.
#include <charconv>
#include <cstdint>
#include <cstring>
#include <sqlite3.h>
#include <string>

namespace {

// Most millions of steps of SQLite's machine for a query, about a minute: a file of someone else
// may ask for more.
constexpr int most_steps = 2000;

struct database {
  sqlite3 *handle;
  int opened, steps;
  // Cells of the last result, each ended by a zero byte; or the reason of the failure.
  std::string cells;
};

void add_cell(std::string &cells, const char *text) {
  cells.append(text == nullptr ? "" : text).push_back('\0');
}

// Writes numbers with all digits; SQLite's own texts of numbers have only 15.
void add_row(std::string &cells, sqlite3_stmt *statement) {
  for (int i = 0; i < sqlite3_column_count(statement); ++i) {
    char digits[32] = {};
    if (sqlite3_column_type(statement, i) == SQLITE_FLOAT) {
      std::to_chars(digits, digits + sizeof digits, sqlite3_column_double(statement, i));
      add_cell(cells, digits);
    } else {
      add_cell(cells, reinterpret_cast<const char *>(sqlite3_column_text(statement, i)));
    }
  }
}

// A value is t and a text, or r and the digits of a number.
int bind(sqlite3_stmt *statement, int i, const char *value) {
  double number = 0.0;
  if (*value == 't')
    return sqlite3_bind_text(statement, i, value + 1, -1, SQLITE_TRANSIENT);
  std::from_chars(value + 1, value + std::strlen(value), number);
  return sqlite3_bind_double(statement, i, number);
}

// Interrupts a query that takes too many steps.
int count_steps(void *self) { return ++static_cast<database *>(self)->steps > most_steps; }

int run(database &self, const char *sql, const char *values, const char *end) {
  int code = self.opened;
  while (code == SQLITE_OK && *sql != '\0') {
    sqlite3_stmt *statement = nullptr;
    code = sqlite3_prepare_v2(self.handle, sql, -1, &statement, &sql);
    for (int i = 1; code == SQLITE_OK && values < end; ++i, values += std::strlen(values) + 1)
      code = bind(statement, i, values);
    while (code == SQLITE_OK && sqlite3_step(statement) == SQLITE_ROW)
      add_row(self.cells, statement);
    // Gives the code of the last step and releases the locks of the file.
    const int ended = sqlite3_finalize(statement);
    code = code == SQLITE_OK ? ended : code;
  }
  return code;
}

} // namespace

extern "C" {

// Opens a database. A missing file is created. The first query reports a failure.
database *bayesindent_open_database(const char *path) {
  auto *const self = new database();
  self->opened = sqlite3_open(path, &self->handle);
  // The file may be a stranger's: what its schema says is not run.
  sqlite3_db_config(self->handle, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(self->handle, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(self->handle, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_progress_handler(self->handle, 1000000, count_steps, self);
  return self;
}

// Closes the file; uncommitted changes are lost.
void bayesindent_close_database(database *self) {
  sqlite3_close_v2(self->handle);
  delete self;
}

// Executes statements, separated by semicolons. The parameters of the first take their values from
// `length` bytes; a zero byte ends each value. Returns the cells of the resulting rows, `bytes` in
// all, or the reason of a failure, whose result code is `code`.
const char *bayesindent_query(database *self, const char *sql, const char *values,
                              std::int32_t length, std::int32_t *bytes, std::int32_t *code) {
  self->cells.clear();
  self->steps = 0;
  *code = run(*self, sql, values, values + length);
  if (*code != SQLITE_OK)
    self->cells = sqlite3_errmsg(self->handle);
  *bytes = static_cast<std::int32_t>(self->cells.size());
  return self->cells.data();
}
}
