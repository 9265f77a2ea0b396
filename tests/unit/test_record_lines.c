/* SPDX-License-Identifier: MIT */
/* Each wrong command line of `record` gives one line, which is compared word for word, also with --raw. */
#include "tests/unit/lines_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <cmocka.h>

static const struct lines_row POINTS[] = {
    {"-o FILE is needed", {"record x.yaml"}},
    {"scanhead: a.xyz: no recorder has this ending; allowed are .ply .las .ptx .e57 .poses.csv .waves.csv .pcapng "
     ".shs .obj .gltf .glb .fbx",
     {"record x.yaml -o a.xyz"}},
    {"scanhead: record: -o a.ply: given twice", {"record x.yaml -o a.ply -o a.ply"}},
    {"scanhead: record: at most 8 files",
     {"record x.yaml -o 1.ply -o 2.ply -o 3.ply -o 4.ply -o 5.ply -o 6.ply -o 7.ply -o 8.ply -o 9.ply"}},
    {"--send, --relay, --ready-fd: allowed with --raw",
     {"record x.yaml -o a.ply --send t", "record x.yaml -o a.ply --relay 1", "record x.yaml -o a.ply --ready-fd 3"}},
    {"--repair: only --stats, --quiet and more of --repair are allowed with it",
     {"record --repair a --ascii", "record --repair a -o b.ply"}},
    {"--listen, --wait, --replug: a CONFIG runs in this process; allowed only with a head on a wire",
     {"record x.yaml -o a.ply --listen", "record x.yaml -o a.ply --wait 1", "record x.yml -o a.ply --replug 1"}},
    {"--wait, --replug: a recorded stream is there or not; allowed only with a head on a wire",
     {"record a.shs -o a.ply --wait 1", "record a.pcapng -o a.ply --replug 1"}},
    {"--replug: an open descriptor can not be opened again; allowed with usb, tty:PATH and tcp:HOST:PORT",
     {"record fd:0 -o a.ply --replug 1"}},
    {"--split and --each: --split writes only files of each scan; allowed is one of them",
     {"record x.yaml -o a.ply --split --each"}},
    {"-o a-1.ply: with --each the file of one scan of a.ply has that name; allowed is any other name",
     {"record x.yaml -o a.ply -o a-1.ply --each"}},
    {"--station: a recorded stream has the scans that it has; allowed with a CONFIG, and with a head on a wire "
     "without --listen",
     {"record a.shs -o a.ply --station 2", "record a.shs -o a.ply --station all"}},
    {"--frames: a recorded stream has the scans that it has; allowed with a CONFIG, and with a head on a wire "
     "without --listen",
     {"record a.pcapng -o a.ply --frames 0"}},
    {"--duration: a recorded stream has the scans that it has; allowed with a CONFIG, and with a head on a wire",
     {"record a.shs -o a.ply --duration 0.01", "record a.pcapng -o a.ply --listen --duration 1"}},
    {"--station: --listen sends no command; allowed with a CONFIG, and with a head on a wire without --listen",
     {"record tcp:a:1 -o a.ply --listen --station 2"}},
    {"--frames: --listen sends no command; allowed with a CONFIG, and with a head on a wire without --listen",
     {"record tcp:a:1 -o a.ply --listen --frames 0"}},
    {"--mesh: no .ply is among the files; .obj, .gltf, .glb, .fbx are meshes without it",
     {"record x.yaml -o a.las --mesh"}},
    {"--sparse: no .ply is among the files", {"record x.yaml -o a.las --sparse 1"}},
    {"--mesh, --sparse: a .ply can be only one of the two; allowed is --sparse with a mesh as .obj, .gltf, .glb or "
     ".fbx",
     {"record x.yaml -o a.ply --mesh --sparse 1"}},
    {"--sparse 1e9: not a number from 1e-06 to 1000000", {"record x.yaml -o a.ply --sparse 1e9"}},
    {"--sparse-seed needs --sparse", {"record x.yaml -o a.ply --sparse-seed 0"}},
    {"--ply-columns: with --mesh and --sparse allowed are range, reflectance, label, station, frame, colour, xyz",
     {"record x.yaml -o a.ply --mesh --ply-columns time", "record x.yaml -o a.ply --sparse 1 --ply-columns echo",
      "record x.yaml -o a.ply --mesh --ply-columns float"}},
    {"--ply-columns amplitude: allowed, each once and with commas between: range reflectance time echo label station "
     "frame attributes colour float xyz",
     {"record x.yaml -o a.ply --mesh --ply-columns amplitude"}},
    {"--empty-shots: a .ply with --mesh or --sparse can not hold them",
     {"record x.yaml -o a.ply --mesh --empty-shots", "record x.yaml -o a.ply --sparse 1 --empty-shots"}},
    {"--long-edge: no mesh is among the files: .ply with --mesh or --sparse, .obj, .gltf, .glb, .fbx",
     {"record x.yaml -o a.ply --long-edge 0"}},
    {"--ply-names: no .ply is among the files", {"record x.yaml -o a.las --ply-names cloudcompare"}},
    {"--ply-columns: no .ply is among the files", {"record x.yaml -o a.las --ply-columns xyz"}},
    {"--ascii: no .ply is among the files", {"record x.yaml -o a.las --ascii"}},
    {"--empty-shots: no .ply and no .e57 is among the files", {"record x.yaml -o a.las --empty-shots"}},
    {"--las-version: no .las is among the files",
     {"record x.yaml -o a.ply --las-version 1.2", "record x.yaml -o a.ply --las-version 1.4"}},
    {"--wdp: no .las is among the files", {"record x.yaml -o a.ply --wdp"}},
    {"--wdp: LAS 1.2 has no waveforms; allowed is --las-version 1.4",
     {"record x.yaml -o a.las --wdp --las-version 1.2"}},
    {"--colour red: allowed are none, solid, range, height, reflectance, label, frame, texture",
     {"record x.yaml -o a.ply --colour red"}},
    {"--ply-names x: allowed are scanhead, cloudcompare", {"record x.yaml -o a.ply --ply-names x"}},
    {"--ply-columns range,size: allowed, each once and with commas between: range reflectance time echo label "
     "station frame attributes colour float xyz",
     {"record x.yaml -o a.ply --ply-columns range,size"}},
    {"--las-version 1.3: allowed are 1.2, 1.4", {"record x.yaml -o a.las --las-version 1.3"}},
    {"--colour-rgb 1,2: allowed are three whole numbers from 0 to 255: 255,128,0",
     {"record x.yaml -o a.ply --colour-rgb 1,2"}},
    {"--colour-rgb 1,2,256: allowed are three whole numbers from 0 to 255: 255,128,0",
     {"record x.yaml -o a.ply --colour-rgb 1,2,256"}},
    {"--colour-rgb -1,2,3: allowed are three whole numbers from 0 to 255: 255,128,0",
     {"record x.yaml -o a.ply --colour-rgb -1,2,3"}},
    {"--colour-rgb 1,2.5,3: allowed are three whole numbers from 0 to 255: 255,128,0",
     {"record x.yaml -o a.ply --colour-rgb 1,2.5,3"}},
    {"--colour-limits 1,1: allowed are two numbers, the second one above the first: 0,30",
     {"record x.yaml -o a.ply --colour-limits 1,1"}},
    {"--colour-limits 1: allowed are two numbers, the second one above the first: 0,30",
     {"record x.yaml -o a.ply --colour-limits 1"}},
    {"--colour: no .ply, .las, .ptx, .e57, .obj, .gltf, .glb or .fbx is among the files, or --ply-columns has no "
     "colour",
     {"record x.yaml -o a.shs --colour label", "record x.yaml -o a.ply --colour height --ply-columns xyz"}},
    {"--colour-rgb needs --colour solid",
     {"record x.yaml -o a.ply --colour-rgb 1,2,3", "record x.yaml -o a.ply --colour label --colour-rgb 1,2,3"}},
    {"--colour solid needs --colour-rgb R,G,B", {"record x.yaml -o a.ply --colour solid"}},
    {"--colour-limits needs --colour range, height or frame",
     {"record x.yaml -o a.ply --colour-limits 1,2", "record x.yaml -o a.ply --colour label --colour-limits 1,2"}},
    {"--colour texture needs a CONFIG as SOURCE; a head on a wire sends the texels itself if its configuration has "
     "output.colour: texture",
     {"record tcp:a:1 -o a.ply --colour texture"}},
    {"SOURCE nothing: allowed usb, usb:VID:PID:SERIAL, tty:PATH, tcp:HOST:PORT, fd:N, FILE.shs, FILE.pcapng, "
     "CONFIG.yaml",
     {"record nothing -o a.ply"}},
    {"--set, --crs and --threads need a CONFIG as SOURCE",
     {"record tcp:a:1 -o a.ply --set a=b", "record tcp:a:1 -o a.ply --crs utm"}},
    {"--scenario, --truth and --surfaces need a CONFIG as SOURCE",
     {"record tcp:a:1 -o a.ply --scenario f", "record tcp:a:1 -o a.ply --truth f",
      "record tcp:a:1 -o a.ply --surfaces f"}},
};

static const struct lines_row RAW[] = {
    {"-o FILE.pcapng is needed", {"record --raw udp:0.0.0.0:1"}},
    {"-o a.ply: with --raw allowed is NAME.pcapng", {"record --raw udp:0.0.0.0:1 -o a.ply"}},
    {"-o b.pcapng: --raw writes one file, and there is a.pcapng",
     {"record --raw udp:0.0.0.0:1 -o a.pcapng -o b.pcapng"}},
    {"SOURCE x.yaml: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw x.yaml -o a.pcapng"}},
    {"SOURCE udp:0.0.0.0: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw udp:0.0.0.0 -o a.pcapng"}},
    {"SOURCE udp::1: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw udp::1 -o a.pcapng"}},
    {"SOURCE udp:a:65536: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw udp:a:65536 -o a.pcapng"}},
    {"SOURCE udp:a:1,: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw udp:a:1, -o a.pcapng"}},
    {"SOURCE udp:a:1;2: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw udp:a:1;2 -o a.pcapng"}},
    {"udp:a:1,1: port 1 is given twice", {"record --raw udp:a:1,1 -o a.pcapng"}},
    {"udp:a:5,6,7,6: port 6 is given twice", {"record --raw udp:a:5,6,7,6 -o a.pcapng"}},
    {"SOURCE udp:a:1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17: with --raw allowed are udp:ADDRESS:PORT,PORT,... and "
     "tcp:HOST:PORT",
     {"record --raw udp:a:1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17 -o a.pcapng"}},
    {"SOURCE tcp:a:0: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw tcp:a:0 -o a.pcapng"}},
    {"SOURCE tcp:a:1,2: with --raw allowed are udp:ADDRESS:PORT,PORT,... and tcp:HOST:PORT",
     {"record --raw tcp:a:1,2 -o a.pcapng"}},
    {"udp:a:1: --send and --relay need tcp:HOST:PORT",
     {"record --raw udp:a:1 -o a.pcapng --relay 1", "record --raw udp:a:1 -o a.pcapng --send x"}},
    {"--relay a: allowed is PORT or ADDRESS:PORT, with a port from 0 (the system's choice) to 65535",
     {"record --raw tcp:a:1 -o a.pcapng --relay a"}},
    {"--send and --relay: with --relay only the client sends; allowed is one of them",
     {"record --raw tcp:a:1 -o a.pcapng --send x --relay 1"}},
    {"--send \\q: allowed after a backslash: n, r, t, 0, \\, \", ', or x and two hexadecimal digits",
     {"record --raw tcp:a:1 -o a.pcapng --send \\q"}},
    {"--send : it is empty", {"record --raw tcp:a:1 -o a.pcapng --send="}},
};

/* Each option goes with each format that has it. The only error left is the missing configuration. */
static const struct lines_row GOOD[] = {
    {"scanhead: none.yaml: cannot be opened: No such file or directory; a YAML file is needed",
     {"record none.yaml -o a.ply --empty-shots", "record none.yaml -o a.e57 --empty-shots",
      "record none.yaml -o a.las -o a.e57 --empty-shots", "record none.yaml -o a.ply --ascii --ply-names cloudcompare",
      "record none.yaml -o a.ply --ply-columns range", "record none.yaml -o a.las --las-version 1.2",
      "record none.yaml -o a.las --las-version 1.4 --wdp", "record none.yaml -o a.ply -o a.las --wdp --ascii"}},
};

static void that_go(void **state)
{
    (void)state;
    lines_expect(GOOD, sizeof GOOD / sizeof GOOD[0]);
}

static void of_points(void **state)
{
    (void)state;
    lines_expect(POINTS, sizeof POINTS / sizeof POINTS[0]);
}

static void of_raw_data(void **state)
{
    (void)state;
    lines_expect(RAW, sizeof RAW / sizeof RAW[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(of_points), cmocka_unit_test(of_raw_data),
                                       cmocka_unit_test(that_go)};
    return cmocka_run_group_tests_name("command lines of record", tests, NULL, NULL);
}
