/* SPDX-License-Identifier: MIT */
/* A client for each link: a thread that behaves like a good recorder (client.c). */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_CLIENT_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_CLIENT_H

#include <stdint.h>

#include "core/err.h"

struct loop;
struct soak;

/* A client for each link that can have one. only: number of the one link; 0: all. */
int soak_clients_open(struct soak *soak, const struct loop *loop, uint32_t only, struct sh_err *err);
int soak_clients_start(struct soak *soak, struct sh_err *err);
void soak_clients_join(struct soak *soak);
void soak_clients_close(struct soak *soak);

#endif
