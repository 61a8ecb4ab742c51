#include "core/capture.h"
