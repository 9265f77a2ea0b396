/* Campaigns: the same bytes in 1, 2 and 7 shards, killed and gone on with; by Slurm's variables and by GNU parallel.
 * What was changed since is found, and nothing is mixed. */
#include <sys/file.h>
#include <sys/inotify.h>

#include "tests/wire/room.h"

/* Two stations, three pulse rates: six jobs of some ten thousand pulses. */
static const char CONFIG[] =
    "head: {profile: any-rate, prr_hz: 100000, lines_hz: 50, pan_deg_s: 60, pan_stop_deg: 6}\n"
    "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
    "stations:\n  - {position_m: [0, 0, 1.5], lat_deg: 52, lon_deg: 13, height_m: 40}\n  - {position_m: [0.5, 0.25, 1.5], heading_deg: 30, lat_deg: 52.00001, lon_deg: 13, height_m: 40}\n"
    "noise: {range: on}\n";

enum { JOBS = 6 };

static const char *const NAMES[JOBS] = {"0001_station-1_head.prr_hz=100000", "0002_station-2_head.prr_hz=100000",
                                        "0003_station-1_head.prr_hz=150000", "0004_station-2_head.prr_hz=150000",
                                        "0005_station-1_head.prr_hz=200000", "0006_station-2_head.prr_hz=200000"};

static int setup(void **state)
{
    if (wire_setup(state) != 0) return -1;
    room_write(*state);
    wire_write_text(*state, "config.yaml", CONFIG);
    return 0;
}

/* Folders of campaigns and what is in them. */
static int teardown(void **state)
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

/* The words of a campaign in `dir`, after those in `first`; more ends with NULL, or is NULL. */
struct words {
    const char *word[WIRE_MAX_ARGS];
    char config[352], dir[352];
    int n;
};

static void campaign(struct wire *wire, struct words *w, const char *const *first, const char *dir,
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

static pid_t start(struct wire *wire, const char *dir, const char *const *more)
{
    struct words w;
    campaign(wire, &w, (const char *const[]){"batch", NULL}, dir, more);
    return wire_spawn(wire, w.word, "out", "err", -1);
}

static int run(struct wire *wire, const char *dir, const char *const *more)
{
    return wire_wait(wire, start(wire, dir, more));
}

#define WITH(...) ((const char *const[]){__VA_ARGS__, NULL})

static void expect(struct wire *wire, const char *dir, const char *const *more, int status, const char *says)
{
    const int got = run(wire, dir, more);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    if (got != status || strstr(err, says) == NULL)
        fail_msg("status %d, not %d; no \"%s\" in: %s", got, status, says, err);
    free(err);
}

static const char *in_dir(const struct wire *wire, const char *dir, const char *name)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    return wire_path(wire, path);
}

static const char *file_of(const struct wire *wire, const char *dir, int job, const char *ending)
{
    char name[128];
    snprintf(name, sizeof name, "%s%s", NAMES[job], ending);
    return in_dir(wire, dir, name);
}

static void expect_same(const char *path, const char *other)
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

/* Both campaigns have the same files and the same manifest, and nothing that isn't whole. */
static void expect_equal(struct wire *wire, const char *dir, const char *other)
{
    for (int i = 0; i < JOBS; i++)
        for (int k = 0; k < 2; k++)
            expect_same(file_of(wire, dir, i, k ? ".las" : ".ply"), file_of(wire, other, i, k ? ".las" : ".ply"));
    expect_same(in_dir(wire, dir, "manifest.json"), in_dir(wire, other, "manifest.json"));
    DIR *all = opendir(wire_path(wire, dir));
    assert_non_null(all);
    for (struct dirent *entry; (entry = readdir(all)) != NULL;)
        assert_null(strstr(entry->d_name, ".part"));
    closedir(all);
}

static void whole(struct wire *wire, const char *dir)
{
    expect(wire, dir, WITH("--quiet"), 0, "");
    expect(wire, dir, WITH("--merge"), 0, "6 jobs are whole");
}

static void shards(struct wire *wire, const char *dir, int n, const char *threads)
{
    for (int i = n; i >= 1; i--) {
        char shard[32];
        snprintf(shard, sizeof shard, "%d/%d", i, n);
        assert_int_equal(run(wire, dir, WITH("--shard", shard, "--threads", threads, "--quiet")), 0);
    }
    expect(wire, dir, WITH("--merge"), 0, "6 jobs are whole");
}

/* ---- the campaign as it should be, made once: "ref" in each test's folder leads to it */

static void *ref;

static int make_ref(void **state)
{
    (void)state;
    if (setup(&ref) != 0) return -1;
    whole(ref, "one");
    return 0;
}

static int remove_ref(void **state)
{
    (void)state;
    return teardown(&ref);
}

static int setup_with_ref(void **state)
{
    char path[352];
    if (setup(state) != 0) return -1;
    snprintf(path, sizeof path, "%s", wire_path(ref, "one"));
    return symlink(path, wire_path(*state, "ref"));
}

/* One job by `record`, one by one, is the same file; so is the whole in 2 and in 7 shards, which then run from the last to
 * the first: one of them has no job. */
static void test_shards(void **state)
{
    struct wire *wire = *state;
    shards(wire, "two", 2, "2");
    shards(wire, "seven", 7, "1");
    expect_equal(wire, "two", "ref");
    expect_equal(wire, "seven", "ref");
    char config[352], ply[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "alone.ply"));
    assert_int_equal(wire_wait(wire, wire_spawn(wire,
                                                WITH("record", config, "-o", ply, "--set", "head.prr_hz=150000",
                                                     "--station", "2", "--crs", "utm", "--quiet"),
                                                "out", "err", -1)),
                     0);
    expect_same(ply, file_of(wire, "ref", 3, ".ply"));
}

/* Replaces a text in a file once. */
static void change(const char *path, const char *from, const char *to)
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

/* Meshes that one process shares among combinations, and BVHs among those of the same places, change no byte: two
 * scanners, two places of the second one, three rates of the first; in one process, and in one for each job. */
static void test_shared(void **state)
{
    static const char sweep[] = "stations.1.position_m=[0.5,0.25,1.5],[-0.5,0,1.25]";
    struct wire *wire = *state;
    change(wire_path(wire, "config.yaml"), "heading_deg: 30", "scanner: {head: {prr_hz: 300000}}");
    expect(wire, "one", WITH("--sweep", sweep), 0, "12 jobs done, 12 of them now; meshes read 1 time\n");
    expect(wire, "one", WITH("--sweep", sweep, "--merge"), 0, "12 jobs are whole");
    for (int i = 1; i <= 12; i++) {
        char shard[32];
        snprintf(shard, sizeof shard, "%d/12", i);
        expect(wire, "each", WITH("--sweep", sweep, "--shard", shard), 0, "1 jobs done, 1 of them now");
    }
    expect(wire, "each", WITH("--sweep", sweep, "--merge"), 0, "12 jobs are whole");
    expect_same(in_dir(wire, "each", "manifest.json"), in_dir(wire, "one", "manifest.json"));
}

/* ---- killed */

/* Waits until something whose name ends so has come, or changed, in the folder, `n` times; 0: the program ended before. */
static int wait_for(int notify, pid_t pid, const char *ending, int n)
{
    char buf[8192] __attribute__((aligned(8)));
    const int end = pidfd_open(pid, 0);
    assert_true(end >= 0);
    while (n > 0) {
        struct pollfd on[2] = {{.fd = notify, .events = POLLIN}, {.fd = end, .events = POLLIN}};
        assert_true(poll(on, 2, DEADLINE_MS) > 0);
        const ssize_t got = on[0].revents != 0 ? read(notify, buf, sizeof buf) : 0;
        if (got <= 0) break;
        for (const char *at = buf; at < buf + got && n > 0;) {
            const struct inotify_event *event = (const void *)at;
            const size_t len = event->len > 0 ? strlen(event->name) : 0;
            if (len >= strlen(ending) && strcmp(event->name + len - strlen(ending), ending) == 0) n--;
            at += sizeof *event + event->len;
        }
    }
    close(end);
    return n == 0;
}

/* Killed once in each of these moments, one after the other, in one campaign; the cut is another one each time. */
static const struct moment {
    const char *shard;
    uint32_t events;
    const char *ending;
    int n, signal;
} MOMENTS[] = {
    {"1/1", IN_CREATE, ".las.part", 1, SIGKILL}, /* within the first job */
    {"2/2", IN_MOVED_TO, ".ply", 1, SIGKILL},    /* one of its files is whole, the other one isn't */
    {"1/1", IN_MODIFY, ".jsonl", 1, SIGKILL},    /* a line is there */
    {"1/3", IN_CREATE, ".las.part", 1, SIGTERM}, /* asked to end, within a job */
    {"1/1", IN_CREATE, ".ply.part", 2, SIGKILL}, /* within the second of those that were left */
};

static void test_killed(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(mkdir(wire_path(wire, "killed"), 0700), 0);
    for (size_t i = 0; i < sizeof MOMENTS / sizeof MOMENTS[0]; i++) {
        const struct moment *m = &MOMENTS[i];
        const int notify = inotify_init1(IN_CLOEXEC);
        assert_true(inotify_add_watch(notify, wire_path(wire, "killed"), m->events) >= 0);
        const pid_t pid = start(wire, "killed", WITH("--shard", m->shard, "--quiet"));
        const int came = wait_for(notify, pid, m->ending, m->n);
        if (came) kill(pid, m->signal);
        const int status = wire_wait(wire, pid);
        close(notify);
        /* 0, too: it may have come to its end before the signal did */
        assert_true(status == 0 || (came && status == (m->signal == SIGKILL ? 256 + SIGKILL : 1)));
        /* what bears its own name is whole, whether it is in a manifest or not */
        for (int job = 0; job < JOBS; job++)
            for (int k = 0; k < 2; k++) {
                const char *ending = k ? ".las" : ".ply";
                if (access(file_of(wire, "killed", job, ending), F_OK) == 0)
                    expect_same(file_of(wire, "killed", job, ending), file_of(wire, "ref", job, ending));
            }
    }
    expect(wire, "killed", WITH("--shard", "1/2"), 0, "shard 1/2");
    expect(wire, "killed", WITH("--shard", "2/2"), 0, "shard 2/2");
    expect(wire, "killed", WITH("--merge"), 0, "6 jobs are whole");
    expect_equal(wire, "killed", "ref");
}

/* A signal while points are being written: nothing of the job stays. */
static void test_interrupted(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(mkdir(wire_path(wire, "long"), 0700), 0);
    const int notify = inotify_init1(IN_CLOEXEC);
    assert_true(inotify_add_watch(notify, wire_path(wire, "long"), IN_MODIFY) >= 0);
    const pid_t pid = start(wire, "long", WITH("--frames", "1000", "--quiet")); /* 10 million pulses */
    assert_true(wait_for(notify, pid, ".ply.part", 1));
    kill(pid, SIGTERM);
    assert_int_equal(wire_wait(wire, pid), 1);
    close(notify);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "interrupted: 0 of 6 jobs of shard 1/1 are done"));
    free(err);
    assert_int_equal(unlink(in_dir(wire, "long", "manifest-1-of-1.jsonl")), 0);
    assert_int_equal(rmdir(wire_path(wire, "long")), 0);
}

/* ---- what isn't whole any more */

static void spoil(const struct wire *wire, int job, const char *ending, off_t cut, off_t flip)
{
    const char *path = file_of(wire, "one", job, ending);
    struct stat st;
    assert_int_equal(stat(path, &st), 0);
    if (cut != 0) assert_int_equal(truncate(path, st.st_size - cut), 0);
    if (flip == 0) return;
    char c;
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    assert_int_equal(pread(fd, &c, 1, st.st_size - flip), 1);
    c ^= 1;
    assert_int_equal(pwrite(fd, &c, 1, st.st_size - flip), 1);
    close(fd);
}

static void test_spoilt(void **state)
{
    struct wire *wire = *state;
    whole(wire, "one");
    spoil(wire, 0, ".ply", 1, 0);
    spoil(wire, 2, ".las", 0, 9);
    assert_int_equal(unlink(file_of(wire, "one", 3, ".ply")), 0);
    /* a line that was cut short, and a part of a file */
    struct stat st;
    assert_int_equal(stat(in_dir(wire, "one", "manifest-1-of-1.jsonl"), &st), 0);
    assert_int_equal(truncate(in_dir(wire, "one", "manifest-1-of-1.jsonl"), st.st_size - 2), 0);
    FILE *part = fopen(file_of(wire, "one", 5, ".ply.part"), "w");
    assert_true(part != NULL && fputs("ply\n", part) >= 0 && fclose(part) == 0);
    expect(wire, "one", WITH("--merge"), 1, "job 1, ");
    char *err = wire_read(wire_path(wire, "err"), NULL);
    for (const char *const *says = WITH("bytes, and had", "job 3, ", "(sha256)", "job 4, ", "is not there", "job 6, ",
                                        ": missing", "4 of 6 jobs");
         *says != NULL; says++)
        if (strstr(err, *says) == NULL) fail_msg("no \"%s\" in: %s", *says, err);
    assert_null(strstr(err, "job 2, "));
    free(err);
    expect(wire, "one", NULL, 0, "6 jobs done, 4 of them now");
    assert_int_not_equal(access(in_dir(wire, "one", "manifest.json"), F_OK), 0); /* it was out of date */
    expect(wire, "one", WITH("--merge"), 0, "6 jobs are whole");
    expect_equal(wire, "one", "ref");
    expect(wire, "one", NULL, 0, "6 jobs done, 0 of them now");
    assert_int_equal(access(in_dir(wire, "one", "manifest.json"), F_OK), 0);
}

/* Each is refused until it is as it was; --force makes the jobs again. */
static void test_nothing_is_mixed(void **state)
{
    struct wire *wire = *state;
    char manifest[352], engine[128];
    assert_int_equal(run(wire, "one", WITH("--shard", "1/3", "--quiet")), 0);
    expect(wire, "one", WITH("--list"), 0, "");
    char *list = wire_read(wire_path(wire, "out"), NULL);
    const char *second = strchr(list, '\n') + 1;
    assert_memory_equal(list, "done 0001_station-1_head.prr_hz=100000 station 1 head.prr_hz=100000\n",
                        (size_t)(second - list));
    assert_memory_equal(second, "-    0002_", 10);
    free(list);
    /* how fast it is computed is no part of a job */
    expect(wire, "one", WITH("--set", "loop.queue_ms=100", "--list"), 0, "");
    list = wire_read(wire_path(wire, "out"), NULL);
    assert_memory_equal(list, "done ", 5);
    free(list);
    change(wire_path(wire, "config.yaml"), "1.5]", "1.6]");
    expect(wire, "one", WITH("--shard", "2/3"), 1, "another text of the configuration");
    expect(wire, "one", WITH("--merge"), 1, "another text of the configuration");
    change(wire_path(wire, "config.yaml"), "1.6]", "1.5]");
    change(wire_path(wire, "room.obj"), "\nv ", "\n# moved\nv ");
    expect(wire, "one", WITH("--shard", "2/3"), 1, "mesh");
    change(wire_path(wire, "room.obj"), "\n# moved\nv ", "\nv ");
    expect(wire, "one", WITH("--set", "noise.seed=5"), 1, "values of keys");
    expect(wire, "one", WITH("--stations", "2"), 1, "another station");
    expect(wire, "one", WITH("--colour", "label"), 1, "other options");
    snprintf(manifest, sizeof manifest, "%s", in_dir(wire, "one", "manifest-1-of-3.jsonl"));
    char *text = wire_read(manifest, NULL), *at = strstr(text, "\"engine\":\"");
    assert_non_null(at);
    snprintf(engine, sizeof engine, "%.*s", (int)strcspn(at + 10, "\""), at + 10);
    free(text);
    change(manifest, engine, "Embree 3.0.0, packets of 2, abacus");
    expect(wire, "one", WITH("--shard", "2/3"), 1, "processor");
    /* of two kinds, which --merge finds, wherever it runs */
    expect(wire, "one", WITH("--force", "--shard", "2/3"), 0, "shard 2/3");
    expect(wire, "one", WITH("--merge"), 1, "abacus");
    change(manifest, "Embree 3.0.0, packets of 2, abacus", engine);
    change(manifest, "\"program\":\"", "\"program\":\"0.");
    expect(wire, "one", WITH("--shard", "2/3"), 1, "release");
    expect(wire, "one", WITH("--force", "--quiet"), 0, "");
    expect(wire, "one", WITH("--merge"), 0, "6 jobs are whole");
    assert_int_equal(link(file_of(wire, "one", 0, ".ply"), in_dir(wire, "one", "0001_before.ply")), 0);
    expect(wire, "one", WITH("--merge"), 0, "1 files are of no job of this campaign, the first: 0001_before.ply");
}

/* ---- others at work, and jobs that fail */

static void test_locked(void **state)
{
    struct wire *wire = *state;
    assert_int_equal(run(wire, "one", WITH("--shard", "1/2", "--quiet")), 0);
    const int fd = open(in_dir(wire, "one", "manifest-2-of-2.jsonl"), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    assert_int_equal(flock(fd, LOCK_EX | LOCK_NB), 0);
    expect(wire, "one", WITH("--shard", "2/2"), 1, "another process is at shard 2/2");
    close(fd);
    expect(wire, "one", WITH("--shard", "2/2"), 0, "3 jobs done, 3 of them now");
}

/* A mesh that can't be loaded fails its jobs, and no others; a value out of range stops all before the first one. */
static void test_failing(void **state)
{
    struct wire *wire = *state;
    char sweep[800];
    wire_write_text(wire, "broken.obj", "v 0 0 0\nf 1 2 3\n");
    snprintf(sweep, sizeof sweep, "scene.meshes.0.file=%s,%s", wire_path(wire, "room.obj"),
             wire_path(wire, "broken.obj"));
    expect(wire, "one", WITH("--sweep", sweep), 1, "6 of 12 jobs of shard 1/1 failed");
    char *text = wire_read(in_dir(wire, "one", "manifest-1-of-1.jsonl"), NULL);
    int lines = 0;
    for (const char *at = text; (at = strchr(at, '\n')) != NULL; at++)
        lines++;
    assert_int_equal(lines, 6);
    free(text);
    expect(wire, "none", WITH("--sweep", "head.lines_hz=50,1e9"), 2, "head.lines_hz");
    expect(wire, "none", WITH("--stations", "3"), 2, "allowed 1 to 2");
    expect(wire, "none", WITH("--set", "time.epoch=utc"), 2, "time.epoch");
    /* names of files would say what isn't so */
    expect(wire, "none", WITH("--sweep", "head.frames=1,2", "--frames", "1"), 2, "--frames sets it, too");
    expect(wire, "none", WITH("--sweep", "output.crs=local,utm"), 2, "--crs sets it, too");
    expect(wire, "none", WITH("--sweep", "head.station=1,2"), 2, "that of --stations");
    expect(wire, "none", WITH("--sweep", "scene.meshes.0.scale=1,2", "--set", "scene.meshes[0].scale=3"), 2,
           "is in --set and in --sweep");
    assert_int_not_equal(access(wire_path(wire, "none"), F_OK), 0); /* nothing was begun */
}

/* All that a mesh is written with is the job's: of two frames, two images. Without one of them it isn't whole. */
static void test_images(void **state)
{
    struct wire *wire = *state;
    char config[352], dir[352];
    const char *job[] = {"batch",    config,  "-o",       dir,   "--stations", "2",  "--frames", "2",
                         "--colour", "range", "--format", "obj", "--quiet",    NULL, NULL};
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(dir, sizeof dir, "%s", wire_path(wire, "images"));
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 0);
    assert_int_equal(unlink(in_dir(wire, "images", "0001_station-2.2.png")), 0);
    job[sizeof job / sizeof job[0] - 2] = "--merge";
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "0001_station-2.2.png: is not there"));
    free(err);
}

static int points_of(struct wire *wire, const char *name)
{
    int n = -1;
    char *text = wire_read(in_dir(wire, "dark", name), NULL);
    const char *at = strstr(text, "element vertex ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "element vertex %d", &n), 1);
    free(text);
    return n;
}

/* The faults of a scenario are in each job, whatever scanner its station has; what is in the file counts, not its name. */
static void test_scenario(void **state)
{
    struct wire *wire = *state;
    char config[352], dir[352], scenario[352], other[352];
    const char *job[] = {"batch", config, "-o", dir, "--format", "ply", "--quiet", "--scenario", scenario, NULL};
    const char **last = &job[sizeof job / sizeof job[0] - 2];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(dir, sizeof dir, "%s", wire_path(wire, "dark"));
    snprintf(scenario, sizeof scenario, "%s", wire_path(wire, "dark.yaml"));
    snprintf(other, sizeof other, "%s", wire_path(wire, "other.yaml"));
    change(config, "heading_deg: 30,", "heading_deg: 30, scanner: {noise: {seed: 7}},");
    wire_write_text(wire, "dark.yaml", "faults: [{kind: laser_off, from_pulse: 3000}]\n");
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 0);
    /* The others are blind: all 10,000 pulses of a job have 3,900 points where none is dark. */
    assert_in_range(points_of(wire, "0001_station-1.ply"), 1000, 3000);
    assert_in_range(points_of(wire, "0002_station-2.ply"), 1000, 3000);
    wire_write_text(wire, "other.yaml", "faults: [{kind: laser_off, from_pulse: 3000}]\n");
    *last = other;
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 0);
    change(other, "3000", "4000");
    assert_int_equal(wire_wait(wire, wire_spawn(wire, job, "out", "err", -1)), 1);
    char *err = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(err, "scenario"));
    free(err);
}

/* ---- engines */

static void by_script(struct wire *wire, const char *shell, const char *script, const char *dir)
{
    struct words w;
    campaign(wire, &w, WITH(script), dir, WITH("--quiet"));
    const int status = wire_wait(wire, wire_spawn_program(wire, shell, w.word, "out", "err", -1));
    if (status != 0) wire_show(wire, "err");
    assert_int_equal(status, 0);
}

/* The script as Slurm runs it: by bash, once for each task, with Slurm's variables. Directives are comments. Tasks 4, 6 and
 * 8 of an array are shards 1 to 3. */
static void test_slurm(void **state)
{
    struct wire *wire = *state;
    setenv("SCANHEAD", wire_program(), 1);
    setenv("SLURM_ARRAY_TASK_MIN", "4", 1);
    setenv("SLURM_ARRAY_TASK_STEP", "2", 1);
    setenv("SLURM_ARRAY_TASK_COUNT", "3", 1);
    setenv("SLURM_CPUS_PER_TASK", "1", 1);
    for (const char *const *id = WITH("8", "4", "6"); *id != NULL; id++) {
        setenv("SLURM_ARRAY_TASK_ID", *id, 1);
        by_script(wire, "/bin/bash", "config/campaign/slurm.sh", "slurm");
    }
    assert_int_equal(access(in_dir(wire, "slurm", "manifest-3-of-3.jsonl"), F_OK), 0);
    expect(wire, "slurm", WITH("--merge"), 0, "6 jobs are whole");
    expect_equal(wire, "slurm", "ref");
    /* some tasks again, of an array of seven */
    setenv("SHARDS", "7", 1);
    setenv("SLURM_ARRAY_TASK_ID", "3", 1);
    by_script(wire, "/bin/bash", "config/campaign/slurm.sh", "again");
    assert_int_equal(access(in_dir(wire, "again", "manifest-3-of-7.jsonl"), F_OK), 0);
    expect_same(file_of(wire, "again", 2, ".ply"), file_of(wire, "ref", 2, ".ply"));
    unsetenv("SHARDS");
    unsetenv("SLURM_ARRAY_TASK_ID");
    struct words w;
    campaign(wire, &w, WITH("config/campaign/slurm.sh"), "none", NULL);
    assert_true(wire_wait(wire, wire_spawn_program(wire, "/bin/bash", w.word, "out", "err", -1)) != 0);
}

static void test_parallel(void **state)
{
    struct wire *wire = *state;
    if (system("command -v parallel >/dev/null") != 0) {
        print_message("# no GNU parallel\n");
        skip();
    }
    setenv("SCANHEAD", wire_program(), 1);
    setenv("SHARDS", "3", 1);
    by_script(wire, "/bin/sh", "config/campaign/parallel.sh", "parallel");
    unsetenv("SHARDS");
    expect_equal(wire, "parallel", "ref");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_shards, setup_with_ref, teardown),
        cmocka_unit_test_setup_teardown(test_shared, setup, teardown),
        cmocka_unit_test_setup_teardown(test_killed, setup_with_ref, teardown),
        cmocka_unit_test_setup_teardown(test_interrupted, setup, teardown),
        cmocka_unit_test_setup_teardown(test_spoilt, setup_with_ref, teardown),
        cmocka_unit_test_setup_teardown(test_nothing_is_mixed, setup, teardown),
        cmocka_unit_test_setup_teardown(test_locked, setup, teardown),
        cmocka_unit_test_setup_teardown(test_failing, setup, teardown),
        cmocka_unit_test_setup_teardown(test_images, setup, teardown),
        cmocka_unit_test_setup_teardown(test_scenario, setup, teardown),
        cmocka_unit_test_setup_teardown(test_slurm, setup_with_ref, teardown),
        cmocka_unit_test_setup_teardown(test_parallel, setup_with_ref, teardown),
    };
    return cmocka_run_group_tests(tests, make_ref, remove_ref);
}
