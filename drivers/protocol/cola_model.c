/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_model.h"

#include <stddef.h>
#include <string.h>

static const struct cola_model models[] = {
    {"TiM561", "V2.62-16.02.16", "V2.62-16", 1, 1, 0, 0, 0, 0, 0, 5, COLA_PORTS_TIM},
    {"TiM571", "V2.62-16.02.16", "V2.62-16", 1, 1, 0, 0, 0, 0, 0, 5, COLA_PORTS_TIM},
    {"TiM781", "V4.1.0", "V4.1.0", 1, 1, 0, 48, 48, 1, 3, 5, COLA_PORTS_TIM},
    {"LMS111", "V1.50", "V1.50", 2, 0, 0, 48, 10, 0, 0, 11, COLA_PORTS_LMS},
    {NULL, "V1.00", "V1.00", 1, 1, 0, 48, 48, 1, 3, 5, COLA_PORTS_TIM},
};

const struct cola_model *cola_model_find(const char *model)
{
    const struct cola_model *m = models;
    while (m->model != NULL && strcmp(m->model, model) != 0)
        m++;
    return m;
}
