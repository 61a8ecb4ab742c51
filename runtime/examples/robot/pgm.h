/* A grey picture from a binary PGM file of 8 bits; a robot takes its camera's pixels instead.
 * djpeg -grayscale -pnm photo.jpg > photo.pgm makes one. */
#ifndef PGM_H_
#define PGM_H_

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* width * height bytes, to be freed, or NULL. */
static uint8_t* ReadPgm(const char* path, int* width, int* height) {
  uint8_t* pixels = NULL;
  int most = 0;
  FILE* file = fopen(path, "rb");
  if (file == NULL) return NULL;
  if (fscanf(file, "P5 %d %d %d", width, height, &most) == 3 && most == 255 && *width > 0 && *height > 0 &&
      *width <= 65536 && *height <= 65536 && fgetc(file) != EOF) {
    const size_t size = (size_t)*width * (size_t)*height;
    pixels = (uint8_t*)malloc(size);
    if (pixels != NULL && fread(pixels, 1, size, file) != size) {
      free(pixels);
      pixels = NULL;
    }
  }
  fclose(file);
  return pixels;
}

#endif /* PGM_H_ */
