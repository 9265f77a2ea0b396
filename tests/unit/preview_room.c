/* SPDX-License-Identifier: MIT */
#include "tests/unit/preview_room.h"

#include "core/bytes.h"
#include "firmware_sim/base/clock.h"
#include "tests/unit/site_rig.h"

/* The L is (0, 0) (6, 0) (6, 2) (2, 2) (2, 5) (0, 5), from z = 0 to 2.4; its faces look inward. */
static const char ROOM[] = "v 0 0 0\nv 6 0 0\nv 6 2 0\nv 2 2 0\nv 2 5 0\nv 0 5 0\n"
                           "v 0 0 2.4\nv 6 0 2.4\nv 6 2 2.4\nv 2 2 2.4\nv 2 5 2.4\nv 0 5 2.4\n"
                           "f 2 1 7 8\nf 3 2 8 9\nf 4 3 9 10\nf 5 4 10 11\nf 6 5 11 12\nf 1 6 12 7\n"
                           "f 1 2 3 4\nf 1 4 5 6\nf 10 9 8 7\nf 12 11 10 7\n";

/* A closed body is in the right leg, from the ground to 0.1 m below the ceiling, wide enough to stand in. None of
 * its walls goes through a place of the grid. */
const char ROOM_BODY[] = "o body\nv 3.1 0.2 0.01\nv 5.1 0.2 0.01\nv 5.1 1.8 0.01\nv 3.1 1.8 0.01\n"
                         "v 3.1 0.2 2.3\nv 5.1 0.2 2.3\nv 5.1 1.8 2.3\nv 3.1 1.8 2.3\n"
                         "f 13 16 15 14\nf 17 18 19 20\nf 13 14 18 17\nf 14 15 19 18\nf 15 16 20 19\nf 16 13 17 20\n";

struct room room_open_with(const char *tripod, const char *body)
{
    struct room r;
    char text[1024], mesh[1024];
    snprintf(mesh, sizeof mesh, "%s%s", ROOM, body);
    write_in("room.obj", mesh);
    snprintf(
        text, sizeof text,
        "head: {profile: full-sweep, prr_hz: 100000, lines_hz: 100, pan_deg_s: 100, frames: 1}\n"
        "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
        "stations:\n  - {position_m: [5, 1, 1.2], heading_deg: 0%s}\n  - {position_m: [1, 1, 1.2], heading_deg: 0}\n",
        tripod);
    write_in("test.yaml", text);
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load_for(cfg, SITE_WRITTEN_OUT, NULL, NULL, &r.site, &err) != SH_OK) fail_msg("%s", err.text);
    const struct coverage_spec spec = {.bvh = r.site->bvh, .cell_m = 0.2, .memory_mib = 64, .threads = 1};
    if (coverage_create(&spec, NULL, &r.coverage, &err) != SH_OK) fail_msg("%s", err.text);
    const struct preview_options options = {.cfg = cfg, .site = r.site, .coverage = r.coverage, .cell_m = spec.cell_m};
    if (preview_create(&options, &r.preview, &err) != SH_OK) fail_msg("%s", err.text);
    return r;
}

struct room room_open(const char *tripod)
{
    return room_open_with(tripod, "");
}

void room_close(struct room *r)
{
    preview_free(r->preview);
    coverage_free(r->coverage);
    site_free(r->site);
}

int room_ask(struct room *r, const char *path, const char *query, struct web_body *out)
{
    for (;;) {
        const int rc = preview_get(r->preview, path, query, out, &err);
        if (rc != SH_OK || out->len > 0) return rc;
        free(out->bytes);
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
}

struct web_body room_need(struct room *r, const char *path, const char *query)
{
    struct web_body body;
    if (room_ask(r, path, query, &body) != SH_OK) fail_msg("%s?%s: %s", path, query, err.text);
    return body;
}

int room_sees(const struct web_body *b, uint32_t cell)
{
    return (int)(le_get64(b->bytes + 72 + 8 * (cell / 64)) >> cell % 64 & 1);
}

double room_number(const char *json, const char *key)
{
    const char *at = strstr(json, key);
    if (at == NULL) fail_msg("no %s in %s", key, json);
    return atof(at + strlen(key) + 2);
}
