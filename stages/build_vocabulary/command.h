#pragma once

#include "core/line/command.h"

namespace cairn::build_vocabulary {

// cairn stage build-vocabulary features.db -o vocabulary.db
Command BuildVocabularyCommand();

}  // namespace cairn::build_vocabulary
