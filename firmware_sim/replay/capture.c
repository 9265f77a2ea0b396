/* SPDX-License-Identifier: MIT */
#include "firmware_sim/replay/capture.h"

#include <stdlib.h>

#include "core/of_file.h"
#include "firmware_sim/replay/capture_inside.h"

int capture_load(const char *path, const struct sh_report *report, struct replay_capture **out, struct sh_err *err)
{
    struct sh_err why = {0};
    *out = NULL;
    struct replay_capture *c = calloc(1, sizeof *c);
    if (c == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for it", path);
    c->report = report;
    int rc = capture_read_flows(c, path, err);
    if (rc == SH_OK && (rc = capture_build(c, &why)) != SH_OK) sh_fail(err, rc, "%s: %s", path, why.text);
    if (rc == SH_ESTOPPED) sh_fail_stopped(err);
    if (rc == SH_OK && c->n_places == 0 && c->counts.unknown_links != 0)
        rc =
            sh_fail(err, SH_EINPUT,
                    "%s: packets of link type %u; allowed are Ethernet (1), raw IP (101, 228, 229), Linux cooked (113, "
                    "276) and loopback (0, 108)",
                    path, c->counts.unknown_link);
    if (rc == SH_OK && c->n_places == 0)
        rc = sh_fail(
            err, SH_EFORMAT,
            "%s: no device sends anything in its %llu packets; required is TCP or UDP with data, or a recording of a head",
            path, (unsigned long long)c->counts.packets);
    for (size_t i = 0; i < c->n_flows; i++)
        free(c->flow[i].segment);
    free(c->flow);
    free(c->file);
    c->flow = NULL;
    c->file = NULL;
    c->n_flows = 0;
    if (rc != SH_OK)
        capture_free(c);
    else
        *out = c;
    return sh_of_file(rc, err);
}

void capture_forget(struct replay_capture *c, uint32_t place)
{
    struct capture_store *store = &c->store[place];
    free(store->bytes);
    free(store->message);
    free(store->run);
    free(store->request);
    *store = (struct capture_store){0};
    c->place[place] = (struct capture_place){0};
}

void capture_free(struct replay_capture *c)
{
    if (c == NULL) return;
    for (uint32_t i = 0; i < CAPTURE_MAX_TALKS; i++)
        capture_forget(c, i);
    free(c);
}

uint32_t capture_n(const struct replay_capture *c)
{
    return c->n_places;
}

const struct capture_place *capture_place(const struct replay_capture *c, uint32_t i)
{
    return &c->place[i];
}

void capture_get_counts(const struct replay_capture *c, struct capture_counts *counts)
{
    *counts = c->counts;
}

double capture_duration_s(const struct replay_capture *c)
{
    return 1e-9 * (double)c->now_ns;
}
