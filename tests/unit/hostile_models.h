/* SPDX-License-Identifier: MIT */
/* Small whole models of the formats that Assimp reads. The tests damage them. */
#ifndef TESTS_UNIT_HOSTILE_MODELS_H
#define TESTS_UNIT_HOSTILE_MODELS_H

#include <stddef.h>
#include <stdint.h>

enum { HOSTILE_FORMATS = 5 };

struct hostile_model {
    const char *ending;
    char *bytes;
    size_t n;
};

/* Returns 0 where the package that has some of the models is missing. */
int hostile_models_open(void);
void hostile_models_close(void);

/* Returns a model by number. The model's format is number % HOSTILE_FORMATS, and the models of a format come in
 * turn. */
const struct hostile_model *hostile_model(uint64_t number);
const char *hostile_format(int format);

#endif
