#include "drivers/protocol/cola_model.h"

#include <stddef.h>
#include <string.h>

static const struct cola_model models[] = {
    {"TiM561", "V2.62-16.02.16", "V2.62-16", 1, 1, 0, 0},
    {"TiM571", "V2.62-16.02.16", "V2.62-16", 1, 1, 0, 0},
    {"TiM781", "V4.1.0", "V4.1.0", 1, 1, 0, 48},
    {"LMS111", "V1.50", "V1.50", 2, 0, 0, 10},
    {NULL, "V1.00", "V1.00", 1, 1, 0, 48},
};

const struct cola_model *cola_model_find(const char *model)
{
    const struct cola_model *m = models;
    while (m->model != NULL && strcmp(m->model, model) != 0)
        m++;
    return m;
}
