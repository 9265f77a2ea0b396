/* SPDX-License-Identifier: MIT */
#include "tests/unit/save_rig.h"

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct past *save_rig_past;
struct save *save_rig;
static struct sh_err err;

void save_rig_set_temporary(const char *name)
{
    char path[600], here[512];
    assert_non_null(getcwd(here, sizeof here));
    snprintf(path, sizeof path, "%s/%s", here, name);
    setenv("TMPDIR", path, 1);
}

int save_rig_take(struct past *to, struct scanhead *sh, uint32_t n_points)
{
    struct scanhead_frame frame;
    while (scanhead_next(sh, &frame, -1) == 0) {
        past_take(to, &frame);
        if (frame.type == SCANHEAD_POINTS && --n_points == 0) return 1;
    }
    return 0;
}

int save_rig_begin(void **state)
{
    (void)state;
    struct scanhead *sh;
    const struct past_limits limits = {PAST_MOST_POINTS, PAST_MOST_BYTES};
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "o floor\nv -30 -30 0\nv 30 -30 0\nv 30 30 0\nv -30 30 0\nf 1 2 3 4\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}, {position_m: [3, 0, 2]}]\noutput: {crs: local}\n");
    does(&app_record, "c.yaml -o s.shs -o s.ply --station all --quiet", 0);
    save_rig_past = past_create(&limits);
    assert_non_null(save_rig_past);
    assert_int_equal(scanhead_open("s.shs", &sh, NULL, 0), 0);
    assert_int_equal(save_rig_take(save_rig_past, sh, UINT32_MAX), 0);
    scanhead_close(sh);
    return mkdir("t", 0777);
}

int save_rig_end(void **state)
{
    past_free(save_rig_past);
    return commands_end(state);
}

int save_rig_open(void **state)
{
    (void)state;
    save_rig_set_temporary("t");
    save_rig = save_create(&(struct save_source){.past = save_rig_past});
    return save_rig == NULL;
}

int save_rig_close(void **state)
{
    (void)state;
    save_free(save_rig);
    save_rig = NULL;
    return 0;
}

size_t save_rig_bytes(const char *path)
{
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    return (size_t)st.st_size;
}

void save_rig_wait(void)
{
    struct web_body body;
    for (int working = 1; working;) {
        if (save_get(save_rig, "", &body, &err) != SH_OK) return;
        working = strstr(body.bytes, "\"state\":\"working\"") != NULL;
        free(body.bytes);
        if (working) poll(NULL, 0, 1);
    }
}

char *save_rig_fetch(unsigned number, size_t *len)
{
    char *all = calloc(1, 1 << 20), query[64];
    assert_non_null(all);
    *len = 0;
    for (struct web_body body = {.len = 1}; body.len > 0;) {
        snprintf(query, sizeof query, *len == 0 ? "file=%u" : "file=%u&from=%zu", number, *len);
        if (save_get_piece(save_rig, query, &body, &err) != SH_OK) fail_msg("%s: %s", query, err.text);
        assert_string_equal(body.type, "application/octet-stream");
        assert_true(*len + body.len < 1 << 20);
        memcpy(all + *len, body.bytes, body.len);
        *len += body.len;
        free(body.bytes);
    }
    return all;
}

void save_rig_same_points(const char *got, size_t len)
{
    char *recorded = contents("s.ply");
    const char *from = strstr(got, "end_header"), *points = strstr(recorded, "end_header");
    const size_t n = save_rig_bytes("s.ply") - (size_t)(points - recorded);
    assert_int_equal(len - (size_t)(from - got), n);
    assert_memory_equal(from, points, n);
    free(recorded);
}

void save_rig_make_ply(void)
{
    const int shown = dup(2), on_file = open("stderr", O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0666);
    struct web_body body;
    assert_true(shown >= 0 && dup2(on_file, 2) == 2);
    const int rc = save_get(save_rig, "as=ply", &body, &err);
    if (rc == SH_OK) save_rig_wait();
    dup2(shown, 2);
    close(shown);
    close(on_file);
    assert_int_equal(rc, SH_OK);
    has(body.bytes, "\"as\":\"ply\",\"file\":1,");
    free(body.bytes);
    assert_int_equal(save_rig_bytes("stderr"), 0);
}
