/* SPDX-License-Identifier: MIT */
#include "tests/wire/batch_rig.h"

#include "tests/wire/room.h"

/* Two stations and three pulse rates make six jobs of some ten thousand pulses. */
static const char CONFIG[] =
    "head: {profile: any-rate, prr_hz: 100000, lines_hz: 50, pan_deg_s: 60, pan_stop_deg: 6}\n"
    "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
    "stations:\n  - {position_m: [0, 0, 1.5], lat_deg: 52, lon_deg: 13, height_m: 40}\n  - {position_m: [0.5, 0.25, 1.5], heading_deg: 30, lat_deg: 52.00001, lon_deg: 13, height_m: 40}\n"
    "noise: {range: on}\n";

const char *const batch_names[BATCH_JOBS] = {"0001_station-1_head.prr_hz=100000", "0002_station-2_head.prr_hz=100000",
                                             "0003_station-1_head.prr_hz=150000", "0004_station-2_head.prr_hz=150000",
                                             "0005_station-1_head.prr_hz=200000", "0006_station-2_head.prr_hz=200000"};

int batch_setup(void **state)
{
    if (wire_setup(state) != 0) return -1;
    room_write(*state);
    wire_write_text(*state, "config.yaml", CONFIG);
    return 0;
}

/* Removes the folders of campaigns and their files. */
int batch_teardown(void **state)
{
    struct wire *wire = *state;
    char command[128];
    for (int i = 0; i < wire->n_children; i++)
        kill(wire->child[i], SIGKILL);
    unlink(wire_path(wire, "ref")); /* a link, whose folder stays */
    snprintf(command, sizeof command, "rm -rf '%s'/*/", wire->dir);
    if (system(command) != 0) return -1;
    return wire_teardown(state);
}

void batch_campaign(struct wire *wire, struct batch_words *w, const char *const *first, const char *dir,
                    const char *const *more)
{
    w->n = 0;
    snprintf(w->config, sizeof w->config, "%s", wire_path(wire, "config.yaml"));
    snprintf(w->dir, sizeof w->dir, "%s", wire_path(wire, dir));
    while (*first != NULL)
        w->word[w->n++] = *first++;
    for (const char *const *p =
             (const char *const[]){w->config, "-o", w->dir, "--sweep", "head.prr_hz=100000,150000,200000", "--format",
                                   "ply,las", "--crs", "utm", NULL};
         *p != NULL; p++)
        w->word[w->n++] = *p;
    while (more != NULL && *more != NULL)
        w->word[w->n++] = *more++;
    w->word[w->n] = NULL;
}

pid_t batch_start(struct wire *wire, const char *dir, const char *const *more)
{
    struct batch_words w;
    batch_campaign(wire, &w, (const char *const[]){"batch", NULL}, dir, more);
    return wire_spawn(wire, w.word, "out", "err", -1);
}

int batch_call(struct wire *wire, const char *dir, const char *const *more)
{
    return wire_wait(wire, batch_start(wire, dir, more));
}

void batch_expect(struct wire *wire, const char *dir, const char *const *more, int status, const char *says)
{
    const int got = batch_call(wire, dir, more);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (got != status || strstr(err, says) == NULL)
        fail_msg("status %d, not %d; no \"%s\" in: %s", got, status, says, err);
    free(err);
}

const char *batch_in(const struct wire *wire, const char *dir, const char *name)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    return wire_path(wire, path);
}

const char *batch_file(const struct wire *wire, const char *dir, int job, const char *ending)
{
    char name[128];
    snprintf(name, sizeof name, "%s%s", batch_names[job], ending);
    return batch_in(wire, dir, name);
}

void batch_expect_same(const char *path, const char *other)
{
    char a[352], b[352];
    size_t n, m;
    snprintf(a, sizeof a, "%s", path);
    snprintf(b, sizeof b, "%s", other);
    char *x = wire_read(a, &n), *y = wire_read(b, &m);
    if (n != m || memcmp(x, y, n) != 0) fail_msg("%s and %s differ", a, b);
    assert_true(n > 1000);
    free(x);
    free(y);
}

void batch_expect_equal(struct wire *wire, const char *dir, const char *other)
{
    for (int i = 0; i < BATCH_JOBS; i++)
        for (int k = 0; k < 2; k++)
            batch_expect_same(batch_file(wire, dir, i, k ? ".las" : ".ply"),
                              batch_file(wire, other, i, k ? ".las" : ".ply"));
    batch_expect_same(batch_in(wire, dir, "manifest.json"), batch_in(wire, other, "manifest.json"));
    DIR *all = opendir(wire_path(wire, dir));
    assert_non_null(all);
    for (struct dirent *entry; (entry = readdir(all)) != NULL;)
        assert_null(strstr(entry->d_name, ".part"));
    closedir(all);
}

void batch_whole(struct wire *wire, const char *dir)
{
    batch_expect(wire, dir, WITH("--quiet"), 0, "");
    batch_expect(wire, dir, WITH("--merge"), 0, "6 jobs are complete");
}

void batch_shards(struct wire *wire, const char *dir, int n, const char *threads)
{
    for (int i = n; i >= 1; i--) {
        char shard[32];
        snprintf(shard, sizeof shard, "%d/%d", i, n);
        assert_int_equal(batch_call(wire, dir, WITH("--shard", shard, "--threads", threads, "--quiet")), 0);
    }
    batch_expect(wire, dir, WITH("--merge"), 0, "6 jobs are complete");
}

static void *ref;

int batch_make_ref(void **state)
{
    (void)state;
    if (batch_setup(&ref) != 0) return -1;
    batch_whole(ref, "one");
    return 0;
}

int batch_remove_ref(void **state)
{
    (void)state;
    return batch_teardown(&ref);
}

int batch_setup_with_ref(void **state)
{
    char path[352];
    if (batch_setup(state) != 0) return -1;
    snprintf(path, sizeof path, "%s", wire_path(ref, "one"));
    return symlink(path, wire_path(*state, "ref"));
}

void batch_change(const char *path, const char *from, const char *to)
{
    char copy[352];
    size_t len;
    snprintf(copy, sizeof copy, "%s", path);
    char *text = wire_read(copy, &len), *at = strstr(text, from);
    assert_non_null(at);
    FILE *f = fopen(copy, "w");
    assert_non_null(f);
    fprintf(f, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
    assert_int_equal(fclose(f), 0);
    free(text);
}
