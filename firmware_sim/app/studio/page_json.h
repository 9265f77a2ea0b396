/* SPDX-License-Identifier: MIT */
/* JSON answers to a page, of a head and of a recording: made in memory, for a web link to send. Any thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_PAGE_JSON_H
#define FIRMWARE_SIM_APP_STUDIO_PAGE_JSON_H

#include <stdint.h>

#include "drivers/link/web.h"
#include "firmware_sim/base/json.h"

/* out: one line of JSON, which `put` writes. SH_ENOMEM, or the error of a value that JSON can't hold; then out has
 * nothing. */
int page_json(void (*put)(struct json *json, const void *ctx), const void *ctx, struct web_body *out,
              struct sh_err *err);

void page_put_vector(struct json *json, const char *key, const double v[3]);
/* "bounds": {"min": [x, y, z], "max": [x, y, z]} */
void page_put_bounds(struct json *json, const double min_m[3], const double max_m[3]);
/* A surface of the array "surfaces". */
void page_put_surface(struct json *json, uint32_t label, const char *object, const char *material);

#endif
