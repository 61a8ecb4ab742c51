#include "core/image_file.h"
