#include "core/vocabulary_tree.h"
