/* SPDX-License-Identifier: MIT */
/* scanhead record: the points of scans to files. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/record/line.h"
#include "firmware_sim/app/studio/record/raw.h"
#include "firmware_sim/app/studio/record/repair.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/limits.h"

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
    return APP_OK;
}

static int take_raw_only(void *values, const char *text)
{
    (void)text;
    ((struct record_line *)values)->raw_only = 1;
    return APP_OK;
}

static const char *const ply_names[] = {"scanhead", "cloudcompare"}, *const las_versions[] = {"1.2", "1.4"};

static int take_ply_columns(void *values, const char *text)
{
    if (ply_columns_read(text, &((struct record_line *)values)->job.files.recorder.columns)) return APP_OK;
    char allowed[128] = "";
    for (int i = 0; ply_column_words[i] != NULL; i++)
        snprintf(allowed + strlen(allowed), sizeof allowed - strlen(allowed), " %s", ply_column_words[i]);
    return app_usage(&app_record, "--ply-columns %s: allowed, each once and with commas between:%s", text, allowed);
}

/* Colours of textures are those that the head sends. */
static void apply_choices(struct record_line *r)
{
    struct colour_choice *colour = &r->job.files.recorder.colour;
    r->job.texture = colour->scale.mode == COLOUR_TEXTURE;
    colour->given = app_is_given(&r->in, "colour") && !r->job.texture;
    r->job.files.own_limits = colour_has_limits(colour->scale.mode) && !r->limited;
    if (r->las_version >= 0) r->job.files.recorder.las_minor = 2 + 2 * r->las_version;
}

/* Checks the options of meshes, and of points spread over them. */
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
            "--mesh, --sparse: a .ply can be only one of the two; allowed is --sparse with a mesh as .obj, .gltf, "
            ".glb or .fbx");
    if (r->sparse_seed >= 0 && !(o->sparse_per_m2 > 0)) return app_usage(&app_record, "--sparse-seed needs --sparse");
    const int is_mesh = o->mesh || o->sparse_per_m2 > 0;
    if (is_mesh && (o->columns & (PLY_TIME | PLY_ECHO | PLY_ATTRIBUTES | PLY_FLOAT)) != 0)
        return app_usage(&app_record, "--ply-columns: with --mesh and --sparse allowed are range, reflectance, label, "
                                      "station, frame, colour, xyz");
    if (is_mesh && o->empty_shots)
        return app_usage(&app_record, "--empty-shots: a .ply with --mesh or --sparse can not hold them");
    record_files_shape(&r->job.files);
    if (r->long_edge >= 0 && !record_files_have_meshes(&r->job.files))
        return app_usage(
            &app_record,
            "--long-edge: no mesh is among the files: .ply with --mesh or --sparse, .obj, .gltf, .glb, .fbx");
    r->job.files.recorder.long_edge = r->long_edge >= 0 ? r->long_edge : RECORD_LONG_EDGE;
    r->job.files.recorder.sparse_seed = r->sparse_seed >= 0 ? (uint64_t)r->sparse_seed : 1;
    return APP_OK;
}

/* An option that is for none of the files is a mistake. */
static int check_options(const struct record_line *r)
{
    const struct recorder_options *o = &r->job.files.recorder;
    const int ply = record_files_have(&r->job.files, ".ply"), las = record_files_have(&r->job.files, ".las");
    const int holds_empty = ply || record_files_have(&r->job.files, ".e57");
    const char *option = o->scalar_names && !ply          ? "--ply-names: no .ply"
                         : o->columns != 0 && !ply        ? "--ply-columns: no .ply"
                         : o->ascii && !ply               ? "--ascii: no .ply"
                         : o->empty_shots && !holds_empty ? "--empty-shots: no .ply and no .e57"
                         : o->las_minor != 0 && !las      ? "--las-version: no .las"
                         : o->las_wdp && !las             ? "--wdp: no .las"
                                                          : NULL;
    if (o->las_wdp && o->las_minor == 2)
        return app_usage(&app_record, "--wdp: LAS 1.2 has no waveforms; allowed is --las-version 1.4");
    return option == NULL ? APP_OK : app_usage(&app_record, "%s is among the files", option);
}

/* Where no command is sent to the head, its station and its number of frames can't be chosen. A duration ends a
 * recording that listens, but a recorded stream would lose its later scans. */
static int check_commands(const struct record_line *r)
{
    const int is_file = app_is_recording(r->in.operand[0]);
    const char *option = r->job.station != 0                            ? "--station"
                         : r->job.recording.frames >= 0                 ? "--frames"
                         : is_file && r->job.recording.duration_s > 0.0 ? "--duration"
                                                                        : NULL;
    if (option == NULL || (!is_file && !r->job.recording.listen)) return APP_OK;
    return app_usage(&app_record, "%s: %s; allowed with a CONFIG, and with a head on a wire%s", option,
                     is_file ? "a recorded stream has the scans that it has" : "--listen sends no command",
                     strcmp(option, "--duration") == 0 ? "" : " without --listen");
}

static int check_colours(const struct record_line *r)
{
    const enum colour_mode mode = r->job.files.recorder.colour.scale.mode;
    if (mode != COLOUR_NONE && !record_files_have_colours(&r->job.files))
        return app_usage(&app_record,
                         "--colour: no .ply, .las, .ptx, .e57, .obj, .gltf, .glb or .fbx is among the files, or "
                         "--ply-columns has no colour");
    const int has_rgb = app_is_given(&r->in, "colour-rgb");
    if (has_rgb && mode != COLOUR_SOLID) return app_usage(&app_record, "--colour-rgb needs --colour solid");
    if (mode == COLOUR_SOLID && !has_rgb) return app_usage(&app_record, "--colour solid needs --colour-rgb R,G,B");
    if (r->limited && !colour_has_limits(mode))
        return app_usage(&app_record, "--colour-limits needs --colour range, height or frame");
    if (mode == COLOUR_TEXTURE && !is_config(r->in.operand[0]))
        return app_usage(
            &app_record,
            "--colour texture needs a CONFIG as SOURCE; a head on a wire sends the texels itself if its configuration "
            "has output.colour: texture");
    return APP_OK;
}

static int record_config(struct config *cfg, void *ctx, struct sh_err *err)
{
    app_warn_settings_file(cfg, "a recording off line has the settings of the configuration");
    return record_job_off_line(ctx, cfg, err);
}

static int check_repair(const struct record_line *r)
{
    if (r->in.n_options > r->n_repairs + (r->job.stats != NULL) + r->quiet)
        return app_usage(&app_record, "--repair: only --stats, --quiet and more of --repair are allowed with it");
    return APP_GO_ON;
}

int record_line_read(struct record_line *r, int argc, char **argv)
{
    *r = (struct record_line){
        .job = {.recording = {.frames = -1}}, .long_edge = -1, .sparse_seed = -1, .las_version = -1};
    int status = app_parse(&app_record, argc, argv, &r->in, r);
    if (status != APP_GO_ON) return status;
    apply_choices(r);
    if (r->raw_only) return app_usage(&app_record, "--send, --relay, --ready-fd: allowed with --raw");
    if (r->n_repairs > 0) return check_repair(r) == APP_GO_ON ? record_line_add_repaired(r) : APP_USAGE;
    if (r->job.files.n == 0 && r->job.stats == NULL) return app_usage(&app_record, "-o FILE is needed");
    if (is_config(r->in.operand[0]) && (r->job.recording.listen || r->job.wait_s > 0 || r->job.recording.replug_s > 0))
        return app_usage(
            &app_record,
            "--listen, --wait, --replug: a CONFIG runs in this process; allowed only with a head on a wire");
    if (app_is_recording(r->in.operand[0]) && (r->job.wait_s > 0 || r->job.recording.replug_s > 0))
        return app_usage(&app_record,
                         "--wait, --replug: a recorded stream is there or not; allowed only with a head on a wire");
    if (strncmp(r->in.operand[0], "fd:", 3) == 0 && r->job.recording.replug_s > 0)
        return app_usage(
            &app_record,
            "--replug: an open descriptor can not be opened again; allowed with usb, tty:PATH and tcp:HOST:PORT");
    if (r->job.files.split && r->job.each)
        return app_usage(&app_record,
                         "--split and --each: --split writes only files of each scan; allowed is one of them");
    struct sh_err err = {0};
    if (r->job.each && record_files_check_each(&r->job.files, &err) != SH_OK)
        return app_usage(&app_record, "%s", err.text);
    if (check_commands(r) != APP_OK || check_meshes(r) != APP_OK || check_options(r) != APP_OK ||
        check_colours(r) != APP_OK || record_line_add_files(r) != APP_OK)
        return APP_USAGE;
    r->job.source = r->in.operand[0];
    r->job.recording.progress = !r->quiet;
    r->job.crs_given = app_is_given(&r->in, "crs");
    if (r->job.station > 0) r->job.recording.first_station = r->job.recording.last_station = (uint32_t)r->job.station;
    return APP_GO_ON;
}

static int record_run(int argc, char **argv)
{
    struct sh_err err = {0};
    struct record_line r;
    if (raw_is_wanted(argc, argv)) return raw_record(argc, argv);
    int status = record_line_read(&r, argc, argv);
    if (status != APP_GO_ON) return status;
    app_catch_signals();
    /* app_with_config checks files, too, and knows those that the configuration reads: it names the better reason. */
    if (r.n_repairs == 0 && is_config(r.job.source)) return app_with_config(&r.in, record_config, &r.job);
    if (app_check_files(&r.in, NULL, &err) != SH_OK) return app_fail(&err);
    if (r.n_repairs > 0) return record_repair(r.repair, r.n_repairs, r.job.stats, r.quiet);
    if (!is_stream(r.job.source))
        return app_usage(
            &app_record,
            "SOURCE %s: allowed usb, usb:VID:PID:SERIAL, tty:PATH, tcp:HOST:PORT, fd:N, FILE.shs, FILE.pcapng, "
            "CONFIG.yaml",
            r.job.source);
    if (r.in.sets.n != 0) return app_usage(&app_record, "--set, --crs and --threads need a CONFIG as SOURCE");
    if (r.in.scenario != NULL || r.job.truth != NULL || r.job.surfaces != NULL)
        return app_usage(&app_record, "--scenario, --truth and --surfaces need a CONFIG as SOURCE");
    return record_job_stream(&r.job, &err) == SH_OK ? APP_OK : app_fail(&err);
}

#define AT(member) offsetof(struct record_line, member)

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_CALL, "output", "FILE", .letter = 'o', .apply = take_file, .file = APP_WRITES,
     .help = "file to write; may be repeated, for up to 8 files"},
    {APP_ALONE, "repair", "FILE", .apply = take_repair, .file = APP_READS,
     .help = "instead of recording: complete the file that a killed recorder or a full disk left (FILE.part), in "
             "place, and print how much was kept; a complete file is only checked. May be repeated; without SOURCE "
             "and -o"},
    {APP_WHOLE, "station", "N|all", .min = 1, .max = CONFIG_MAX_STOPS, .word = "all", .at = AT(job.station),
     .help = "scan from station N, or from all one after the other into the same files"},
    {APP_WHOLE, "frames", "N", .min = 0, .max = HEAD_MAX_FRAMES, .at = AT(job.recording.frames),
     .help = "frames per scan; 0: without end"},
    {APP_NUMBER, "duration", "S", .min = 0.001, .max = 1e8, .at = AT(job.recording.duration_s),
     .help = "end each scan after S seconds of device time: with a CONFIG exact to a pulse, with a head on a wire as "
             "soon as it carries out the command. With --listen the recording ends S seconds after a scan began; it "
             "waits for that scan without end"},
    {APP_FLAG, "split", NULL, .at = AT(job.files.split),
     .help = "write each scan to its own files: NAME-1.las, NAME-2.las, ..., in the order of scans"},
    {APP_FLAG, "each", NULL, .at = AT(job.each), .help = "like --split, in addition to the files of all scans"},
    {APP_FLAG, "listen", NULL, .at = AT(job.recording.listen),
     .help = "send no command: record the stream until it ends or Ctrl-C comes. With --replug only the head's state is "
             "asked for"},
    {APP_NUMBER, "wait", "S", .min = 0.0, .max = 1e8, .at = AT(job.wait_s),
     .help = "wait up to S seconds for SOURCE to appear"},
    {APP_NUMBER, "replug", "S", .min = 0.0, .max = 1e8, .at = AT(job.recording.replug_s),
     .help = "when the head is unplugged, wait up to S seconds for it and continue in the same files"},
    {APP_FLAG, "ascii", NULL, .at = AT(job.files.recorder.ascii), .help = "PLY as text"},
    {APP_CHOICE, "ply-names", "WHOSE", .at = AT(job.files.recorder.scalar_names), OPTION_CHOICES(ply_names),
     .help = "names of columns: scanhead (range, time, ..., the default), or cloudcompare (scalar_range, scalar_time, "
             "..., which CloudCompare shows)"},
    {APP_CALL, "ply-columns", "LIST", .apply = take_ply_columns,
     .help = "columns of .ply beside x, y, z: some of "
             "range,reflectance,time,echo,label,station,frame,attributes,colour; xyz: none of them; float: lengths as "
             "float, within 1 km of the origin (default: all, in double)"},
    {APP_CHOICE, "colour", "BY", .at = AT(job.files.recorder.colour.scale.mode), OPTION_CHOICES(colour_words),
     .help = "value that red, green, blue in .ply, .las, .ptx, .e57 and the texture of meshes show: range, height, "
             "reflectance (grey, -30 to 0 dB), label (a hue per surface), frame (of a trajectory or stops), texture "
             "(of a CONFIG); or solid; none. Default: the colours that the head sends, if any (output.colour)"},
    {APP_CALL, "colour-limits", "LOW,HIGH", .apply = take_colour_limits,
     .help = "limits of the colours of range and height (m) and frame: blue is LOW, red is HIGH. Default: the "
             "smallest and the largest value in the file, which is then written after the last scan"},
    {APP_CALL, "colour-rgb", "R,G,B", .apply = take_colour_rgb, .help = "the colour of --colour solid, 0 to 255 each"},
    {APP_FLAG, "mesh", NULL, .at = AT(job.files.recorder.mesh),
     .help = "write .ply as a mesh of the scan's grid, as .obj, .gltf, .glb and .fbx always are"},
    {APP_NUMBER, "long-edge", "FACTOR", .min = 0, .max = 1e9, .at = AT(long_edge),
     .help = "leave out triangles of meshes with an edge longer than FACTOR times the scan's mean edge (default 10); "
             "0: leave out none"},
    {APP_NUMBER, "sparse", "DENSITY", .min = 1e-6, .max = 1e6, .at = AT(job.files.recorder.sparse_per_m2),
     .help = "write .ply as points spread evenly over the mesh that --mesh writes, DENSITY per square metre"},
    {APP_WHOLE, "sparse-seed", "N", .min = 0, .max = 1000000000, .at = AT(sparse_seed),
     .help = "seed of the random points: the same N gives the same points (default 1)"},
    {APP_CHOICE, "las-version", "1.2|1.4", .at = AT(las_version), OPTION_CHOICES(las_versions),
     .help = "version of .las; 1.2 is for older readers and holds no labels, and up to five returns of a pulse "
             "(default 1.4)"},
    {APP_FLAG, "wdp", NULL, .at = AT(job.files.recorder.las_wdp),
     .help = "write the waveforms of .las to a .wdp beside it, not into it"},
    {APP_FLAG, "empty-shots", NULL, .at = AT(job.files.recorder.empty_shots),
     .help = "keep shots without echo: .ply with NaN coordinates, .e57 with its invalid state"},
    {APP_TEXT, "scenario", "FILE", .at = AT(in.scenario), .file = APP_READS,
     .help = "add the faults of this file (config/faults) to those of a CONFIG"},
    {APP_TEXT, "truth", "FILE", .at = AT(job.truth), .file = APP_FILLS,
     .help = "write each fault that a CONFIG injects as a line of JSON; - is standard output"},
    {APP_TEXT, "surfaces", "FILE", .at = AT(job.surfaces), .file = APP_FILLS,
     .help = "write the surfaces of a CONFIG as CSV: label, object, material, IFC type and GlobalId, colour; - is "
             "standard output"},
    {APP_TEXT, "stats", "FILE", .at = AT(job.stats), .file = APP_FILLS,
     .help = "write counts of the received data as JSON; - is standard output"},
    OPTION_NO_HASH(AT(job.no_hash)),
    OPTION_SET,
    {APP_KEY, "crs", "CRS", .key = "output.crs",
     .help = "write points in this system: local, ecef, utm or geodetic; where the configuration has no output.layout, "
             "also sets output.layout=geo"},
    {APP_KEY, "threads", "N", .key = "loop.threads", .help = "threads that cast; 0: one per processor"},
    {APP_FLAG, "raw", NULL, .at = AT(raw),
     .help = "write all data from udp:ADDRESS:PORT,... or tcp:HOST:PORT, of any protocol, to a .pcapng; its options: "
             "scanhead record --raw --help"},
    {APP_CALL, "send", "TEXT", .apply = take_raw_only, .help = "only with --raw: text to send when connected"},
    {APP_CALL, "relay", "[ADDRESS:]PORT", .apply = take_raw_only,
     .help = "only with --raw: listen there, and record the connections of others"},
    {APP_CALL, "ready-fd", "N", .apply = take_raw_only,
     .help = "only with --raw: descriptor that gets a line of JSON once the recorder listens"},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet), .help = "no progress"},
    OPTION_END
};
/* clang-format on */

static const char HELP_NOTES[] =
    "SOURCE is one of\n"
    "\n"
    "  CONFIG               a configuration: the head runs off line in this process, as fast as it computes.\n"
    "                       Only with it: --set, --crs, --threads, --scenario, --truth, --surfaces,\n"
    "                       --colour texture\n"
    "  usb                  a head on USB, as scanhead list shows it; one of several: usb:vid:pid or\n"
    "                       usb:vid:pid:serial\n"
    "  tty:/dev/...         a serial port\n"
    "  tcp:host:port        a socket\n"
    "  fd:N                 an open descriptor, as of a serial port, a socket or a FIFO\n"
    "  udp:address:port     only with --raw: datagrams of any protocol, to a .pcapng\n"
    "  FILE.shs             a raw stream; FILE.pcapng: its frames as packets\n"
    "\n"
    "The ending of FILE sets the format:\n"
    "\n"
    "  .ply                 points, binary or text, with double coordinates, label and station\n"
    "  .las                 LAS 1.4, point format 6 (7 with --colour): points with CRS, time, returns, label;\n"
    "                       station as point source ID; format 9 (10) with the waveforms that the head sends\n"
    "  .ptx                 a grid per scan, with the scan's pose; shots without echo are in it\n"
    "  .e57                 points of each scan, with its pose\n"
    "  .obj .gltf .glb .fbx a mesh of each scan's grid, which faces the head; its colours (--colour, else those of\n"
    "                       labels) are an image beside it, or within a .glb\n"
    "  .poses.csv           true position and orientation of each scan, or a moving head's trajectory\n"
    "  .waves.csv           the waveforms that the head sends, a row for each window of samples\n"
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
    "  The file of a stream (.shs, .pcapng) begins within a scan.\n"
    "  Ctrl-C came before the end of a scan that has an end (not with --listen).\n"
    "  Frames or pulses were lost on the way.\n"
    "  The head was disconnected within a scan.\n"
    "\n"
    "FILE keeps the data that came. Where it can't be completed, as on a full disk, the written data stay as\n"
    "FILE.part, for --repair, with FILE.grid beside a .ptx, and waveforms in X.wdp.part beside X.las. A recorder\n"
    "does not begin while one of these exists.\n"
    "\n"
    "Ctrl-C or SIGTERM ends a recording with complete files, and so does SIGHUP from a terminal that closes. A\n"
    "second Ctrl-C or SIGTERM within a second counts as the same one. A third ends the recording at once, and so\n"
    "does a second one after more than a second. Under nohup, SIGHUP stays ignored.\n";

const struct app_command app_record = {
    .name = "record",
    .operand = {"SOURCE"},
    .needs = "-o FILE",
    .summary = "write the points of a scan to files",
    .options = OPTIONS,
    .notes = HELP_NOTES,
    .run = record_run,
};
