/* SPDX-License-Identifier: MIT */
/* scanhead record: the points of scans to files. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/record/line.h"
#include "firmware_sim/app/studio/record/raw.h"
#include "firmware_sim/app/studio/record/repair.h"

static const double LONG_EDGE = 10;

static int is_config(const char *source)
{
    return app_ends_in(source, ".yaml") || app_ends_in(source, ".yml");
}

static int is_stream(const char *source)
{
    return strcmp(source, "usb") == 0 || strncmp(source, "usb:", 4) == 0 || strncmp(source, "tty:", 4) == 0 ||
           strncmp(source, "tcp:", 4) == 0 || strncmp(source, "fd:", 3) == 0 || app_is_recording(source);
}

static int take_file(void *values, const char *text)
{
    struct record_line *r = values;
    struct sh_err err = {0};
    return record_files_add(&r->job.files, text, &err) == SH_OK ? APP_OK : app_fail(&err);
}

static int take_repair(void *values, const char *text)
{
    struct record_line *r = values;
    if (r->n_repairs == RECORD_MAX_REPAIRS)
        return app_usage(&app_record, "--repair: at most %d files", RECORD_MAX_REPAIRS);
    r->repair[r->n_repairs++] = text;
    return APP_OK;
}

/* The index of a word; APP_USAGE with the reason printed. */
static int take_word(const char *option, const char *const *words, int n, const char *text, int *index)
{
    char allowed[96] = "";
    for (*index = 0; *index < n; ++*index) {
        if (strcmp(text, words[*index]) == 0) return APP_OK;
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), "%s%s", *index > 0 ? ", " : "",
                 words[*index]);
    }
    return app_usage(&app_record, "--%s %s: allowed are %s", option, text, allowed);
}

static int take_colour(void *values, const char *text)
{
    struct record_line *r = values;
    struct colour_choice *choice = &r->job.files.recorder.colour;
    int i, status = take_word("colour", colour_words, COLOUR_MODES, text, &i);
    if (status != APP_OK) return status;
    r->job.texture = i == COLOUR_TEXTURE; /* which the head sends */
    choice->given = !r->job.texture;
    choice->scale.mode = (enum colour_mode)i;
    r->job.files.own_limits = colour_has_limits(choice->scale.mode) && !r->limited;
    return APP_OK;
}

static int take_colour_rgb(void *values, const char *text)
{
    struct record_line *r = values;
    double v[3];
    int good = app_read_numbers(text, ',', v, 3);
    for (int i = 0; i < 3 && good; i++)
        good = v[i] >= 0 && v[i] <= 255 && v[i] == floor(v[i]);
    if (!good)
        return app_usage(&app_record, "--colour-rgb %s: allowed are three whole numbers from 0 to 255: 255,128,0",
                         text);
    for (int i = 0; i < 3; i++)
        r->job.files.recorder.colour.scale.rgb[i] = (uint8_t)v[i];
    r->has_rgb = 1;
    return APP_OK;
}

static int take_colour_limits(void *values, const char *text)
{
    struct record_line *r = values;
    double v[2];
    if (!app_read_numbers(text, ',', v, 2) || !(v[0] < v[1]))
        return app_usage(&app_record,
                         "--colour-limits %s: allowed are two numbers, the second one above the first: 0,30", text);
    r->job.files.recorder.colour.scale.low = v[0];
    r->job.files.recorder.colour.scale.high = v[1];
    r->limited = 1;
    r->job.files.own_limits = 0;
    return APP_OK;
}

static const char *const ply_names[] = {"scanhead", "cloudcompare"};

static int take_ply_names(void *values, const char *text)
{
    return take_word("ply-names", ply_names, 2, text, &((struct record_line *)values)->job.files.recorder.scalar_names);
}

static int take_ply_columns(void *values, const char *text)
{
    if (ply_columns_read(text, &((struct record_line *)values)->job.files.recorder.columns)) return APP_OK;
    char allowed[128] = "";
    for (int i = 0; ply_column_words[i] != NULL; i++)
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), " %s", ply_column_words[i]);
    return app_usage(&app_record, "--ply-columns %s: allowed, each once and with commas between:%s", text, allowed);
}

static int take_las_version(void *values, const char *text)
{
    static const char *const words[] = {"1.2", "1.4"};
    int i, status = take_word("las-version", words, 2, text, &i);
    if (status == APP_OK) ((struct record_line *)values)->job.files.recorder.las_minor = 2 + 2 * i;
    return status;
}

/* Meshes, and points spread over them. */
static int check_meshes(struct record_line *r)
{
    const struct recorder_options *o = &r->job.files.recorder;
    const int ply = record_files_have(&r->job.files, ".ply");
    if (o->mesh && !ply)
        return app_usage(&app_record,
                         "--mesh: no .ply is among the files; .obj, .gltf, .glb, .fbx are meshes without it");
    if (o->sparse_per_m2 > 0 && !ply) return app_usage(&app_record, "--sparse: no .ply is among the files");
    if (o->mesh && o->sparse_per_m2 > 0)
        return app_usage(
            &app_record,
            "--mesh, --sparse: a .ply is one of the two; allowed --sparse with a mesh as .obj, .gltf, .glb or .fbx");
    if (r->sparse_seed >= 0 && !(o->sparse_per_m2 > 0)) return app_usage(&app_record, "--sparse-seed needs --sparse");
    const int is_mesh = o->mesh || o->sparse_per_m2 > 0;
    if (is_mesh && (o->columns & (PLY_TIME | PLY_ECHO | PLY_ATTRIBUTES | PLY_FLOAT)) != 0)
        return app_usage(&app_record, "--ply-columns: with --mesh and --sparse allowed are range, reflectance, label, "
                                      "station, frame, colour, xyz");
    if (is_mesh && o->empty_shots)
        return app_usage(&app_record, "--empty-shots: a .ply with --mesh or --sparse has no place for them");
    record_files_shape(&r->job.files);
    if (r->long_edge >= 0 && !record_files_have_meshes(&r->job.files))
        return app_usage(
            &app_record,
            "--long-edge: no mesh is among the files: .ply with --mesh or --sparse, .obj, .gltf, .glb, .fbx");
    r->job.files.recorder.long_edge = r->long_edge >= 0 ? r->long_edge : LONG_EDGE;
    r->job.files.recorder.sparse_seed = r->sparse_seed >= 0 ? (uint64_t)r->sparse_seed : 1;
    return APP_OK;
}

/* An option that is for none of the files is a mistake. */
static int check_options(const struct record_line *r)
{
    const struct recorder_options *o = &r->job.files.recorder;
    const int ply = record_files_have(&r->job.files, ".ply"), las = record_files_have(&r->job.files, ".las");
    const char *option = o->scalar_names && !ply     ? "--ply-names: no .ply"
                         : o->columns != 0 && !ply   ? "--ply-columns: no .ply"
                         : o->las_minor != 0 && !las ? "--las-version: no .las"
                                                     : NULL;
    return option == NULL ? APP_OK : app_usage(&app_record, "%s is among the files", option);
}

static int check_colours(const struct record_line *r)
{
    const enum colour_mode mode = r->job.files.recorder.colour.scale.mode;
    if (mode != COLOUR_NONE && !record_files_have_colours(&r->job.files))
        return app_usage(&app_record,
                         "--colour: no .ply, .las, .ptx, .e57, .obj, .gltf, .glb or .fbx is among the files");
    if (r->has_rgb && mode != COLOUR_SOLID) return app_usage(&app_record, "--colour-rgb needs --colour solid");
    if (mode == COLOUR_SOLID && !r->has_rgb) return app_usage(&app_record, "--colour solid needs --colour-rgb R,G,B");
    if (r->limited && !colour_has_limits(mode))
        return app_usage(&app_record, "--colour-limits needs --colour range, height or frame");
    if (mode == COLOUR_TEXTURE && !is_config(r->in.operand[0]))
        return app_usage(&app_record, "--colour texture needs a CONFIG as SOURCE; a head on a wire sends the texels "
                                      "itself where its configuration has output.colour: texture");
    return APP_OK;
}

static int record_config(struct config *cfg, void *ctx, struct sh_err *err)
{
    return record_job_off_line(ctx, cfg, err);
}

static int check_repair(const struct record_line *r)
{
    if (r->in.n_options > r->n_repairs + (r->job.stats != NULL) + r->quiet)
        return app_usage(&app_record, "--repair: only --stats, --quiet and more of --repair are allowed with it");
    return APP_GO_ON;
}

/* The files that are written beside those of -o: one of each scan, and those that a mesh names. */
static int add_names(struct record_line *r)
{
    static const struct {
        const char *mesh, *ending;
    } beside[] = {{".obj", ".mtl"}, {".obj", ".png"}, {".gltf", ".bin"}, {".gltf", ".png"}, {".fbx", ".png"}};
    const int n_files = r->in.n_files;
    int file = 0, status = APP_OK;
    for (int i = 0; i < n_files; i++) {
        struct app_file *named = &r->in.file[i];
        if (named->option == NULL || strcmp(named->option, "output") != 0) continue;
        const struct recorder_ops *ops = r->job.files.file[file++].ops; /* they came in this order */
        named->n_ending = strlen(ops->ending);
        named->each = r->job.files.split || r->job.each;
        for (size_t k = 0; k < sizeof beside / sizeof beside[0] && status == APP_OK; k++) {
            struct app_file other = *named;
            other.ending = beside[k].ending;
            if (strcmp(ops->ending, beside[k].mesh) == 0) status = app_add_file(&r->in, &other);
        }
    }
    return status;
}

int record_line_read(struct record_line *r, int argc, char **argv)
{
    *r = (struct record_line){.job = {.recording = {.frames = -1}}, .long_edge = -1, .sparse_seed = -1};
    int status = app_parse(&app_record, argc, argv, &r->in, r);
    if (status != APP_GO_ON) return status;
    if (r->raw_only != NULL) return app_usage(&app_record, "--send, --relay, --ready-fd: allowed with --raw");
    if (r->n_repairs > 0) return check_repair(r);
    if (r->job.files.n == 0 && r->job.stats == NULL) return app_usage(&app_record, "-o FILE is needed");
    if (is_config(r->in.operand[0]) && (r->job.recording.listen || r->job.wait_s > 0 || r->job.recording.replug_s > 0))
        return app_usage(&app_record,
                         "--listen, --wait, --replug: a CONFIG runs in this process; allowed with a head on a wire");
    if (r->job.files.split && r->job.each)
        return app_usage(&app_record,
                         "--split and --each: --split writes files of each scan alone; allowed one of them");
    struct sh_err err = {0};
    if (r->job.each && record_files_check_each(&r->job.files, &err) != SH_OK)
        return app_usage(&app_record, "%s", err.text);
    if (check_meshes(r) != APP_OK || check_options(r) != APP_OK || check_colours(r) != APP_OK || add_names(r) != APP_OK)
        return APP_USAGE;
    r->job.source = r->in.operand[0];
    r->job.recording.progress = !r->quiet;
    if (r->job.station > 0) r->job.recording.first_station = r->job.recording.last_station = (uint32_t)r->job.station;
    return APP_GO_ON;
}

static int run(int argc, char **argv)
{
    struct sh_err err = {0};
    struct record_line r;
    if (raw_is_wanted(argc, argv)) return raw_record(argc, argv);
    int status = record_line_read(&r, argc, argv);
    if (status != APP_GO_ON) return status;
    if (app_check_files(&r.in, NULL, &err) != SH_OK) return app_fail(&err);
    app_catch_signals();
    if (r.n_repairs > 0) return record_repair(r.repair, r.n_repairs, r.job.stats, r.quiet);
    if (is_config(r.job.source)) return app_with_config(&r.in, record_config, &r.job);
    if (!is_stream(r.job.source))
        return app_usage(
            &app_record,
            "SOURCE %s: allowed usb, usb:VID:PID:SERIAL, tty:PATH, tcp:HOST:PORT, FILE.shs, FILE.pcapng, CONFIG.yaml",
            r.job.source);
    if (r.in.sets.n != 0) return app_usage(&app_record, "--set, --crs and --threads need a CONFIG as SOURCE");
    if (r.in.scenario != NULL || r.job.truth != NULL || r.job.surfaces != NULL)
        return app_usage(&app_record, "--scenario, --truth and --surfaces need a CONFIG as SOURCE");
    return record_job_stream(&r.job, &err) == SH_OK ? APP_OK : app_fail(&err);
}

#define AT(member) offsetof(struct record_line, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_CALL, "output", "FILE", .letter = 'o', .apply = take_file, .file = APP_WRITES, .help = "where to write; may be repeated"},
    {APP_ALONE, "repair", "FILE", .apply = take_repair, .file = APP_READS,
     .help = "instead of recording: make a whole file of what a killed recorder or a full disk has left (FILE.part), in "
             "place, and say how much that is; a whole file is checked. May be repeated; without SOURCE and -o"},
    {APP_WHOLE, "station", "N|all", .min = 1, .max = CONFIG_MAX_STOPS, .word = "all", .at = AT(job.station),
     .help = "scan from station N, or from all one after the other into the same files"},
    {APP_WHOLE, "frames", "N", .min = 0, .max = HEAD_MAX_FRAMES, .at = AT(job.recording.frames),
     .help = "frames per scan; 0: without end"},
    {APP_NUMBER, "duration", "S", .min = 0.001, .max = 1e8, .at = AT(job.recording.duration_s),
     .help = "end each scan after S seconds of device time: of a CONFIG to the pulse, of a head on a wire as "
             "soon as it takes the command"},
    {APP_FLAG, "split", NULL, .at = AT(job.files.split),
     .help = "each scan to files of its own: NAME-1.las, NAME-2.las, ..., in the order of scans"},
    {APP_FLAG, "each", NULL, .at = AT(job.each), .help = "the same beside the files of all scans"},
    {APP_FLAG, "listen", NULL, .at = AT(job.recording.listen),
     .help = "send no command: record what comes until the stream ends or Ctrl-C"},
    {APP_NUMBER, "wait", "S", .min = 0.0, .max = 1e8, .at = AT(job.wait_s),
     .help = "wait up to S seconds for SOURCE to be there"},
    {APP_NUMBER, "replug", "S", .min = 0.0, .max = 1e8, .at = AT(job.recording.replug_s),
     .help = "when the head is unplugged, wait up to S seconds for it and go on in the same files"},
    {APP_FLAG, "ascii", NULL, .at = AT(job.files.recorder.ascii), .help = "PLY as text"},
    {APP_CALL, "ply-names", "WHOSE", .apply = take_ply_names, OPTION_CHOICES(ply_names),
     .help = "scanhead: range, time, ... (the default), or cloudcompare: scalar_range, scalar_time, ..., which it shows"},
    {APP_CALL, "ply-columns", "LIST", .apply = take_ply_columns,
     .help = "of .ply beside x, y, z: some of range,reflectance,time,echo,label,station,frame,attributes,colour; xyz: none "
             "of them; float: lengths as float, within 1 km of the origin (default: all, in double)"},
    {APP_CALL, "colour", "BY", .apply = take_colour, OPTION_CHOICES(colour_words),
     .help = "red, green, blue in .ply, .las, .ptx, .e57, and the texture of meshes, show the range, height, "
             "reflectance (grey, -30 to 0 dB), label (a hue per surface), frame (of a trajectory), texture (of a "
             "CONFIG); or solid; none. Default: as the head sends them, if it does (output.colour)"},
    {APP_CALL, "colour-limits", "LOW,HIGH", .apply = take_colour_limits,
     .help = "of range and height (m) and frame: blue is LOW, red is HIGH. Default: the smallest and the largest in the "
             "file, which is then written when all scans are over"},
    {APP_CALL, "colour-rgb", "R,G,B", .apply = take_colour_rgb, .help = "the colour of --colour solid, 0 to 255 each"},
    {APP_FLAG, "mesh", NULL, .at = AT(job.files.recorder.mesh),
     .help = ".ply is a mesh of the scan's grid, as .obj, .gltf, .glb and .fbx always are"},
    {APP_NUMBER, "long-edge", "FACTOR", .min = 0, .max = 1e9, .at = AT(long_edge),
     .help = "of meshes: leave out triangles with an edge longer than FACTOR times the scan's mean edge (default "
             "10); 0: none"},
    {APP_NUMBER, "sparse", "DENSITY", .min = 1e-6, .max = 1e9, .at = AT(job.files.recorder.sparse_per_m2),
     .help = ".ply is points spread evenly over that mesh, DENSITY a square metre"},
    {APP_WHOLE, "sparse-seed", "N", .min = 0, .max = 1000000000, .at = AT(sparse_seed),
     .help = "which random points: the same N gives the same ones (default 1)"},
    {APP_CALL, "las-version", "1.2|1.4", .apply = take_las_version,
     .help = "of .las; 1.2 is for older readers and holds no labels, five returns of a pulse (default 1.4)"},
    {APP_FLAG, "empty-shots", NULL, .at = AT(job.files.recorder.empty_shots),
     .help = "keep shots without echo: .ply with NaN coordinates, .e57 with its invalid state"},
    {APP_TEXT, "scenario", "FILE", .at = AT(in.scenario), .file = APP_READS,
     .help = "of a CONFIG: with the faults of this file (config/faults) beside its own"},
    {APP_TEXT, "truth", "FILE", .at = AT(job.truth), .file = APP_WRITES,
     .help = "of a CONFIG: write each fault that is injected as a line of JSON; - is standard output"},
    {APP_TEXT, "surfaces", "FILE", .at = AT(job.surfaces), .file = APP_WRITES,
     .help = "of a CONFIG: write the surfaces as CSV: label, object, material, IFC type and GlobalId, colour; - is standard "
             "output"},
    {APP_TEXT, "stats", "FILE", .at = AT(job.stats), .file = APP_WRITES, .help = "write what was received as JSON; - is standard output"},
    OPTION_NO_HASH(AT(job.no_hash)),
    OPTION_SET,
    {APP_KEY_GIVEN, "crs", "CRS", .key = "output.crs", .at = AT(job.crs_given),
     .help = "local, ecef, utm or geodetic: write points in it, as output.layout=geo does, too"},
    {APP_KEY, "threads", "N", .key = "loop.threads", .help = "threads that cast; 0: one per processor"},
    {APP_FLAG, "raw", NULL, .at = AT(raw),
     .help = "of udp:ADDRESS:PORT,... and tcp:HOST:PORT: write what is on the wire, whatever its protocol is, to a "
             ".pcapng; its options: scanhead record --raw --help"},
    {APP_TEXT, "send", "TEXT", .at = AT(raw_only), .help = "only with --raw: what to send when connected"},
    {APP_TEXT, "relay", "[ADDRESS:]PORT", .at = AT(raw_only),
     .help = "only with --raw: listen there, and record the connections of others"},
    {APP_TEXT, "ready-fd", "N", .at = AT(raw_only), .help = "only with --raw: where to say that it listens"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static const char HELP_NOTES[] =
    "SOURCE is one of\n"
    "\n"
    "  CONFIG               a configuration: the head runs off line in this process, as fast as it computes.\n"
    "                       Only with it: --set, --crs, --threads, --scenario, --truth, --surfaces\n"
    "  usb                  a head on USB, as scanhead list shows it; more exactly usb:vid:pid or\n"
    "                       usb:vid:pid:serial\n"
    "  tty:/dev/...         a serial port\n"
    "  tcp:host:port        a socket\n"
    "  udp:address:port     only with --raw: datagrams of any protocol, to a .pcapng\n"
    "  FILE.shs             a raw stream; FILE.pcapng: its frames as packets\n"
    "\n"
    "The ending of FILE says what is written:\n"
    "\n"
    "  .ply                 points, binary or text, with double coordinates, label and station\n"
    "  .las                 LAS 1.4, point format 6 (7 with --colour): points with CRS, time, returns, label;\n"
    "                       station as point source ID\n"
    "  .ptx                 a grid per scan, with the scan's pose; shots without echo are in it\n"
    "  .e57                 points of each scan, with its pose\n"
    "  .obj .gltf .glb .fbx a mesh of each scan's grid, which faces the head; its colours are an image beside it,\n"
    "                       or within a .glb\n"
    "                       (--colour; the label's by itself)\n"
    "  .poses.csv           true position and orientation of each scan, or a moving head's trajectory\n"
    "  .shs                 the raw stream\n"
    "  .pcapng              the stream's frames as packets, for capinfos and tshark\n"
    "\n"
    ".ply and .las hold amplitude and width of the echoes where the head sends them (output.attributes). Several\n"
    "scans go into one file, in one coordinate system: that of the stream (geo layout), or the scene's (polar\n"
    "layout).\n"
    "\n"
    "Exit status 1: the recording is not complete. One of these happened:\n"
    "\n"
    "  The stream ended before the scan did.\n"
    "  Ctrl-C came before a scan with an end had its end (not with --listen).\n"
    "  Frames or pulses were lost on the way.\n"
    "  The head was away within a scan.\n"
    "\n"
    "FILE keeps what came. Where it can't be completed, as on a full disk, what was written stays as FILE.part, for\n"
    "--repair, with FILE.grid beside a .ptx. A recorder does not begin while such a FILE.part is there.\n"
    "\n"
    "Ctrl-C, or SIGTERM, ends a recording in good order. A second signal within a second counts as the same one;\n"
    "a third, or one that comes later, ends it at once.\n";

const struct app_command app_record = {
    .name = "record",
    .operand = {"SOURCE"},
    .needs = "-o FILE",
    .summary = "write the points of a scan to files",
    .options = OPTIONS,
    .notes = HELP_NOTES,
    .run = run,
};
