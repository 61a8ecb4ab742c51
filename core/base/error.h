#pragma once

#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include <fmt/format.h>

namespace cairn {

// Why an operation failed.  The values are the program's exit codes: append only, never renumber.
enum class ErrorCode : int {
  kFailed = 1,           // anything that has no code of its own
  kInvalidArgument = 2,  // an option, a key or a call with a value that is not allowed
  kNotFound = 3,         // a file, an image or a row that does not exist
  kCorrupt = 4,          // a file that is truncated, damaged or not what its name says
  kUnsupported = 5,      // a format, a version or a camera model that this program does not read
  kNoData = 6,           // the input is valid, but nothing is left to work on
  kIo = 7,               // the system refused to read or write
  kGate = 8,             // a map below its recipe's [gate]
  kBusy = 9,             // another process holds the file or the folder
  kCancelled = 10,       // the user stopped it
  // For files that a robot opens or a map is written to: kCorrupt and kIo would not tell the user what to do.
  kEmptyFile = 11,    // no bytes at all
  kTruncated = 12,    // shorter than it says
  kNotSqlite = 13,    // not a SQLite database, but should be one
  kForeignFile = 14,  // a SQLite database of another program
  kTooNew = 15,       // a map of a later format than this program reads
  kTooOld = 16,       // a map of an earlier format: `cairn migrate`
  kNotSigned = 17,    // a signature is required
  kWrongKey = 18,     // signed with another key, or the signature is false
  kReadOnly = 19,     // the folder or file may not be written
  kDiskFull = 20,     // no space is left
  kLost = 21,         // a robot that no longer knows where it is
  // Signed maps that are right in themselves, but not what this robot may take.
  kNotNewer = 22,  // its epoch is not later than that of the map in place, or below the requested minimum
  kOtherMap = 23,  // it has another name: the map of another site
  kNoMemory = 24,  // none is left, or less than the work takes
};

// Stable lower-case name of a code, as it stands in error.json ("corrupt", "no_data", ...).
const char* ErrorCodeName(ErrorCode code);

// A failure as a value.  `message` names the file, what was found, what was expected and the remedy.
struct Error {
  ErrorCode code = ErrorCode::kFailed;
  std::string message;
};

template <typename... Args>
Error MakeError(ErrorCode code, fmt::format_string<Args...> format, Args&&... args) {
  return Error{code, fmt::format(format, std::forward<Args>(args)...)};
}

// `what` (a file, or a part of it) does not hold what was written to it.
template <typename... Args>
Error Corrupt(const std::string& what, fmt::format_string<Args...> format, Args&&... args) {
  return Error{ErrorCode::kCorrupt, what + ": " + fmt::format(format, std::forward<Args>(args)...)};
}

// A value or the error that prevented it.  Never empty; reading the wrong side aborts.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}      // NOLINT: implicit on purpose
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}  // NOLINT

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  T& value() & { return std::get<0>(state_); }
  const T& value() const& { return std::get<0>(state_); }
  T&& value() && { return std::get<0>(std::move(state_)); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  const Error& error() const { return std::get<1>(state_); }

 private:
  std::variant<T, Error> state_;
};

// Success or an error.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Error error) : error_(std::move(error)) {}  // NOLINT: implicit on purpose

  bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  const Error& error() const { return *error_; }

 private:
  std::optional<Error> error_;
};

inline Status Ok() { return Status(); }

}  // namespace cairn

// Returns the error of `expression` (a Status or a Result) from the enclosing function, if it has one.
#define CAIRN_RETURN_IF_ERROR(expression)                                                  \
  do {                                                                                     \
    if (auto cairn_status = (expression); !cairn_status.ok()) return cairn_status.error(); \
  } while (false)

#define CAIRN_CONCAT_INNER(a, b) a##b
#define CAIRN_CONCAT(a, b) CAIRN_CONCAT_INNER(a, b)
// CAIRN_ASSIGN_OR_RETURN(auto x, Expression()): declares x from the value, or returns the error.
#define CAIRN_ASSIGN_OR_RETURN(declaration, expression) \
  CAIRN_ASSIGN_OR_RETURN_INNER(CAIRN_CONCAT(cairn_result_, __LINE__), declaration, expression)
#define CAIRN_ASSIGN_OR_RETURN_INNER(result, declaration, expression) \
  auto result = (expression);                                         \
  if (!result.ok()) return result.error();                            \
  declaration = std::move(result).value()
