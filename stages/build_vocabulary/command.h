#pragma once

#include "core/command.h"

namespace cairn {

// cairn build-vocabulary features.db -o vocabulary.db
Command BuildVocabularyCommand();

}  // namespace cairn
