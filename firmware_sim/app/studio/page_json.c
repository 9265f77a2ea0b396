/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/page_json.h"

#include <stdio.h>
#include <stdlib.h>

int page_json(void (*put)(struct json *json, const void *ctx), const void *ctx, struct web_body *out,
              struct sh_err *err)
{
    struct json json;
    *out = (struct web_body){.type = "application/json"};
    FILE *memory = open_memstream(&out->bytes, &out->len);
    if (memory == NULL) return sh_fail(err, SH_ENOMEM, "no memory for an answer");
    json_begin_one_line(&json, memory);
    put(&json, ctx);
    int rc = json_end(&json, err);
    if (fclose(memory) != 0 && rc == SH_OK) rc = sh_fail(err, SH_ENOMEM, "no memory for an answer");
    if (rc == SH_OK) return SH_OK;
    free(out->bytes);
    out->bytes = NULL;
    return rc;
}

void page_put_vector(struct json *json, const char *key, const double v[3])
{
    json_open_array(json, key);
    for (int k = 0; k < 3; k++)
        json_double(json, NULL, v[k]);
    json_close_array(json);
}

void page_put_bounds(struct json *json, const double min_m[3], const double max_m[3])
{
    json_open_object(json, "bounds");
    page_put_vector(json, "min", min_m);
    page_put_vector(json, "max", max_m);
    json_close_object(json);
}

void page_put_surface(struct json *json, uint32_t label, const char *object, const char *material)
{
    json_open_object(json, NULL);
    json_uint(json, "label", label);
    json_string(json, "object", object);
    json_string(json, "material", material);
    json_close_object(json);
}
