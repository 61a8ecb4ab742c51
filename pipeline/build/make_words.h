#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"

namespace cairn::pipeline {

// Text that is written into a Makefile or passed to make is read again, by make and by the shell that it
// starts.  CheckMakePath and MakeVariables let through only words that both read unchanged.

// Errors: InvalidArgument when a path has characters that Make or a shell would not read as part of a name:
// white space, control characters and $#%:;&|<>()[]{}*?'"`\=!
Status CheckMakePath(const std::string& what, const std::string& path);
// The same for other values; nor may one begin with '~', which a shell would replace.
Status CheckMakeWord(const std::string& what, const std::string& word);

// Variables for make, in the order in which they were set.  `what` names a value in messages.
// Errors of all three: InvalidArgument.
class MakeVariables {
 public:
  // Paths, numbers or names, each as CheckMakePath requires.
  Status Set(const std::string& variable, const std::string& what, const std::vector<std::string>& words);
  // The same for FIRST=SECOND words.
  Status SetPairs(const std::string& variable, const std::string& what,
                  const std::vector<std::pair<std::string, std::string>>& words);
  // Words with which a command begins, separated by blanks.  No quotes, no variables: nothing but words.
  Status SetLauncher(const std::string& variable, const std::string& what, const std::string& words);

  std::string MakefileText() const;               // "VARIABLE := WORDS", a line each
  std::vector<std::string> CommandWords() const;  // "VARIABLE=WORDS"

 private:
  std::vector<std::pair<std::string, std::string>> values_;
};

}  // namespace cairn::pipeline
