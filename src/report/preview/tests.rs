//! Whole pictures of a small synthetic head of hair, drawn and read back.

use super::frame_range::spread;
use super::options::{Colours, Follow, Options, Quality};
use super::renderer::Renderer;
use super::sheet::{Views, animate, sheet};
use super::shot::tests::Memory;
use crate::cache::{ColliderFrame, ColliderMesh, CurveFrame, CurveSet, Frame, Header};
use crate::error::Error;
use crate::report::font;
use crate::report::picture::{AnimationFormat, Image};

/// `n` strands of `POINTS` points that hang from a half sphere, which moves sideways from frame to frame.
fn head_of_hair(n: usize, frames: i32) -> Memory {
    const POINTS: usize = 6;
    let mut set = CurveSet { counts: vec![POINTS as i32; n], ..CurveSet::default() };
    for i in 0..n {
        let (height, turn) = ((i as f32 + 0.5) / n as f32, i as f32 * 2.4);
        let ring = (1.0 - height * height).sqrt();
        for k in 0..POINTS {
            let k = k as f32;
            let out = 0.1 + 0.004 * k;
            set.rest.push([out * ring * turn.cos(), out * height - 0.002 * k * k, out * ring * turn.sin()]);
        }
    }
    set.widths = vec![3e-4; n * POINTS];
    set.id = (0..n as i32).collect();
    set.group = (0..n as i32).map(|i| i % 7).collect();
    set.guide = vec![0; n];
    let head = ColliderMesh {
        name: "head".into(),
        points: vec![[-0.05, -0.05, 0.0], [0.05, -0.05, 0.0], [0.0, 0.05, 0.0]],
        triangles: vec![[0, 1, 2]],
        caps: Vec::new(),
        deforms: false,
        is_skin: false,
        is_plane: false,
    };
    let frame = |k: i32| {
        let shift = 0.3 * k as f32;
        let points: Vec<[f32; 3]> = set.rest.iter().map(|p| [p[0] + shift, p[1], p[2]]).collect();
        let mut motion = [[0.0; 4]; 4];
        (0..4).for_each(|i| motion[i][i] = 1.0);
        motion[0][3] = f64::from(shift);
        Frame {
            frame: 1001 + k,
            hair: Some(CurveFrame { points, ..CurveFrame::default() }),
            head: motion,
            colliders: vec![ColliderFrame { transform: motion, points: None }],
            ..Frame::default()
        }
    };
    let frames: Vec<Frame> = (0..frames).map(frame).collect();
    let range = (1001, 1000 + frames.len() as i32);
    let header = Header {
        metres_per_unit: 1.0,
        fps: 24.0,
        frames: range,
        hair: Some(set),
        colliders: vec![head],
        ..Header::default()
    };
    Memory { header, frames }
}

fn small() -> Options {
    Options { size: (96, 80), supersampling: 2, ..Options::default() }
}

#[test]
fn spread_frames_are_even_and_include_both_ends() {
    assert_eq!(spread((1001, 1100), 4), [1001, 1034, 1067, 1100]);
    assert_eq!(spread((5, 7), 12), [5, 6, 7]);
    assert_eq!(spread((5, 9), 1), [5]);
    assert_eq!(spread((-2, -2), 3), [-2]);
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let shot = head_of_hair(300, 2);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sheet(&shot, &small(), None, &[1001, 1002]).unwrap())
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn beauty_is_deterministic_and_another_picture() {
    let shot = head_of_hair(200, 1);
    let with = |quality, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = Options { quality, ..small() };
        pool.install(|| sheet(&shot, &options, None, &[1001]).unwrap())
    };
    let beauty = with(Quality::Beauty, 1);
    assert_eq!(beauty, with(Quality::Beauty, 3));
    let quick = with(Quality::Quick, 1);
    let off: u32 = beauty.rgb.iter().zip(&quick.rgb).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
    assert!(off as usize > beauty.rgb.len() / 20, "{off}");
}

/// Mean of the linear light of a picture.
fn mean_light(image: &Image) -> f64 {
    let linear = |s: &u8| (f64::from(*s) / 255.0).powf(2.2);
    image.rgb.iter().map(linear).sum::<f64>() / image.rgb.len() as f64
}

/// Strands from a thirtieth of a pixel to half of one cover their share of it.
#[test]
fn pictures_of_all_sizes_have_the_same_tone() {
    let shot = head_of_hair(600, 1);
    let light = |size| {
        let image = sheet(&shot, &Options { size: (size, size), ..small() }, None, &[1001]).unwrap();
        // Without the frame of the page, and without the label.
        let mut cell = Image::new(size, size * 3 / 5);
        for (x, y) in (0..cell.height).flat_map(|y| (0..size).map(move |x| (x, y))) {
            cell.set(x, y, image.get(4 + x, 4 + y));
        }
        mean_light(&cell)
    };
    let large = light(640);
    for size in [40, 120, 240] {
        let off = light(size) / large - 1.0;
        assert!(off.abs() < 0.01, "{size}: {off}");
    }
}

/// The same shot with all of its frames turned about the vertical.
fn turned(mut shot: Memory, degrees: f32) -> Memory {
    let (s, c) = degrees.to_radians().sin_cos();
    let turn = |p: &mut [f32; 3]| *p = [c * p[0] + s * p[2], p[1], c * p[2] - s * p[0]];
    for frame in &mut shot.frames {
        frame.hair.iter_mut().flat_map(|h| &mut h.points).for_each(turn);
        let (s, c) = (f64::from(s), f64::from(c));
        let turned = [[c, 0.0, s, 0.0], [0.0, 1.0, 0.0, 0.0], [-s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]];
        frame.head = turned;
        frame.colliders.iter_mut().for_each(|collider| collider.transform = turned);
    }
    shot
}

#[test]
fn views_are_of_the_head_however_it_is_turned() {
    let page = |shot: &Memory, azimuths_deg: &[f64]| {
        let views = Views { frame: 1001, azimuths_deg: azimuths_deg.to_vec() };
        sheet(shot, &small(), Some(&views), &[]).unwrap()
    };
    let mean_difference = |a: &Image, b: &Image| {
        let sum: u32 = a.rgb.iter().zip(&b.rgb).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
        f64::from(sum) / a.rgb.len() as f64
    };
    let front = page(&head_of_hair(200, 1), &[0.0]);
    // The sky stays where it is.
    let off = mean_difference(&page(&turned(head_of_hair(200, 1), 70.0), &[0.0]), &front);
    assert!(off < 1.0, "{off}");
    let side = mean_difference(&page(&head_of_hair(200, 1), &[90.0]), &front);
    assert!(side > 4.0, "{side}");
    // A joint with other axes, which carries nothing: the picture stays upright.
    let mut other_axes = head_of_hair(200, 1);
    for frame in &mut other_axes.frames {
        frame.head =
            [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    }
    let off = mean_difference(&page(&other_axes, &[0.0]), &front);
    assert!(off < 1.0, "{off}");
}

#[test]
fn hair_fills_the_picture_and_the_camera_follows() {
    let shot = head_of_hair(400, 2);
    let bare = |follow| {
        let renderer = Renderer::new(&shot, Options { follow, ..small() }, &[1001, 1002]).unwrap();
        [renderer.render(1001).unwrap(), renderer.render(1002).unwrap()]
    };
    // Hair is more red than blue; the backdrop is bluish.
    let columns_of_hair = |image: &Image| {
        let hair = |x: u32| {
            (0..image.height).any(|y| {
                let [r, _, b] = image.get(x, y);
                r > b
            })
        };
        (0..image.width).filter(|x| hair(*x)).collect::<Vec<_>>()
    };
    let [first, second] = bare(Follow::Position);
    // Equal up to the rounding of single-precision positions.
    let (a, b) = (columns_of_hair(&first), columns_of_hair(&second));
    assert!(a[0].abs_diff(b[0]) <= 1 && a.len() > 40, "{a:?} {b:?}");
    let [first, second] = bare(Follow::World);
    assert!(columns_of_hair(&second)[0] > columns_of_hair(&first)[0] + 20);
}

#[test]
fn z_up_and_y_up_caches_give_equal_pictures() {
    let y_up = head_of_hair(200, 1);
    let mut z_up = head_of_hair(200, 1);
    z_up.header.z_up = true;
    let turn = |p: &mut [f32; 3]| *p = [p[0], -p[2], p[1]];
    z_up.frames[0].hair.iter_mut().flat_map(|h| &mut h.points).for_each(turn);
    z_up.header.hair.iter_mut().flat_map(|h| &mut h.rest).for_each(turn);
    z_up.header.colliders.iter_mut().flat_map(|c| &mut c.points).for_each(turn);
    for follow in [Follow::Position, Follow::Head] {
        let options = Options { follow, ..small() };
        let (a, b) =
            (sheet(&y_up, &options, None, &[1001]).unwrap(), sheet(&z_up, &options, None, &[1001]).unwrap());
        let off = a.rgb.iter().zip(&b.rgb).filter(|(a, b)| a.abs_diff(**b) > 3).count();
        assert!(off * 200 < a.rgb.len(), "{off} of {} values differ", a.rgb.len());
    }
}

#[test]
fn guides_have_a_visible_minimum_width() {
    let mut shot = head_of_hair(30, 1);
    shot.header.guides = shot.header.hair.take().unwrap();
    shot.header.guides.widths.fill(1e-6);
    shot.frames[0].guides = shot.frames[0].hair.take().unwrap();
    shot.header.colliders.clear();
    shot.frames[0].colliders.clear();
    let image = Renderer::new(&shot, small(), &[1001]).unwrap().render(1001).unwrap();
    let vivid = image.rgb.chunks_exact(3).filter(|p| p.iter().max().unwrap() - p.iter().min().unwrap() > 60);
    assert!(vivid.count() > 100);
}

#[test]
fn colours_show_the_level_of_each_strand() {
    let mut shot = head_of_hair(60, 1);
    let options = Options { colours: Colours::Level, ..small() };
    assert!(Renderer::new(&shot, options.clone(), &[1001]).is_err_and(|e| matches!(e, Error::Usage(_))));
    shot.header.levels = true;
    let redness = |shot: &Memory, options: &Options| -> f64 {
        let image = Renderer::new(shot, options.clone(), &[1001]).unwrap().render(1001).unwrap();
        image.rgb.chunks_exact(3).map(|p| 2.0 * f64::from(p[0]) - f64::from(p[1]) - f64::from(p[2])).sum()
    };
    let mut by_level = [0, 1, 2].map(|level| {
        shot.frames[0].hair.as_mut().unwrap().level = Some(vec![level; 60]);
        redness(&shot, &options)
    });
    assert!(by_level.is_sorted_by(|a, b| a + 1000.0 < *b), "{by_level:?}");
    // Hair colours do not depend on it.
    by_level[1] = redness(&shot, &small());
    shot.frames[0].hair.as_mut().unwrap().level = Some(vec![0; 60]);
    assert_eq!(redness(&shot, &small()), by_level[1]);
    shot.frames[0].hair.as_mut().unwrap().level = Some(vec![0; 59]);
    let renderer = Renderer::new(&shot, options, &[1001]);
    assert!(renderer.is_err_and(|e| matches!(e, Error::Damaged { .. })));
}

#[test]
fn colours_show_where_hair_is_crowded() {
    let mut shot = head_of_hair(300, 2);
    // At the second frame hair is pressed together along one axis, to a third.
    let squeezed = shot.frames[1].hair.as_mut().unwrap();
    squeezed.points.iter_mut().for_each(|p| p[2] /= 3.0);
    let options = Options { colours: Colours::Crowding, follow: Follow::Head, ..small() };
    let renderer = Renderer::new(&shot, options, &[1001, 1002]).unwrap();
    let redness = |frame: i32| -> f64 {
        let image = renderer.render(frame).unwrap();
        let hair = |p: &[u8]| p.iter().max().unwrap() - p.iter().min().unwrap() > 30;
        let pixels: Vec<_> = image.rgb.chunks_exact(3).filter(|p| hair(p)).collect();
        pixels.iter().map(|p| f64::from(p[0]) - f64::from(p[2])).sum::<f64>() / pixels.len() as f64
    };
    let [loose, crowded] = [1001, 1002].map(redness);
    assert!(crowded > loose + 20.0, "{loose} {crowded}");
}

#[test]
fn apng_round_trips_frame_by_frame() {
    let shot = head_of_hair(150, 3);
    let frames = [1001, 1002, 1003];
    let mut bytes = Vec::new();
    animate(&shot, &small(), &frames, 24.0, AnimationFormat::Apng, &mut bytes).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
    let renderer = Renderer::new(&shot, small(), &frames).unwrap();
    for frame in frames {
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rgb).unwrap();
        assert_eq!(rgb, renderer.render(frame).unwrap().rgb);
        let control = reader.info().frame_control().unwrap();
        assert_eq!(f64::from(control.delay_num) / f64::from(control.delay_den), 1.0 / 24.0);
    }
}

#[test]
fn gif_matches_the_pictures_up_to_its_palette_and_the_duration_of_the_shot() {
    let shot = head_of_hair(150, 4);
    let frames = [1001, 1002, 1003, 1004];
    let mut bytes = Vec::new();
    animate(&shot, &small(), &frames, 24.0, AnimationFormat::Gif, &mut bytes).unwrap();
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut reader = options.read_info(bytes.as_slice()).unwrap();
    let renderer = Renderer::new(&shot, small(), &frames).unwrap();
    let mut time = 0;
    for frame in frames {
        let read = reader.read_next_frame().unwrap().unwrap();
        time += read.delay;
        let drawn = renderer.render(frame).unwrap().rgb;
        let off = |(a, b): (&[u8], &[u8])| (0..3).map(|k| u32::from(a[k].abs_diff(b[k]))).sum::<u32>();
        let sum: u32 = read.buffer.chunks(4).zip(drawn.chunks(3)).map(off).sum();
        assert!(f64::from(sum) / (drawn.len() as f64) < 4.0, "mean difference of a value");
    }
    assert_eq!(time, 17, "4/24 s in hundredths");
    assert!(reader.read_next_frame().unwrap().is_none());
}

#[test]
fn sheet_is_a_png_of_labelled_cells() {
    let shot = head_of_hair(50, 5);
    let page = sheet(&shot, &small(), None, &[1001, 1002, 1003, 1004, 1005]).unwrap();
    // Cells of 100 by 84 pixels including gaps; labels are 5 from the left and 12 from the bottom.
    for (k, frame) in (1001..=1005).enumerate() {
        let (x, y) = (4 + k as u32 % 2 * 100 + 5, 4 + k as u32 / 2 * 84 + 80 - 12);
        assert_eq!(font::read_number(&page, x, y, 1, 4, [245; 3]), frame.to_string());
    }
    let bytes = page.to_png().unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    assert_eq!((reader.info().width, reader.info().height), (2 * 100 + 4, 3 * 84 + 4));
    let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut rgb).unwrap();
    assert_eq!(rgb, page.rgb);
}

#[test]
fn views_are_twice_as_large_and_above_the_frames() {
    let shot = head_of_hair(50, 7);
    let views = Views { frame: 1001, azimuths_deg: vec![0.0, 40.0, 145.0] };
    let frames: Vec<i32> = (1001..=1007).collect();
    let page = sheet(&shot, &small(), Some(&views), &frames).unwrap();
    assert_eq!((page.width, page.height), (6 * 100 + 4, 4 * 84 + 4));
    for k in 0..3 {
        let (x, y) = (4 + k * 200 + 5, 4 + 164 - 12);
        assert_eq!(font::read_number(&page, x, y, 1, 4, [245; 3]), "1001");
    }
    for (k, frame) in frames.iter().enumerate() {
        let (x, y) = (4 + k as u32 % 6 * 100 + 5, 4 + (2 + k as u32 / 6) * 84 + 80 - 12);
        assert_eq!(font::read_number(&page, x, y, 1, 4, [245; 3]), frame.to_string());
    }
}

#[test]
fn deforming_collider_is_drawn_with_the_points_of_the_frame() {
    let mut shot = head_of_hair(20, 1);
    let rigid = sheet(&shot, &small(), None, &[1001]).unwrap();
    let raised = |p: &[f32; 3]| [p[0], p[1] + 0.06, p[2]];
    let mesh = &mut shot.header.colliders[0];
    let points: Vec<_> = mesh.points.iter().map(raised).collect();
    mesh.deforms = true;
    shot.frames[0].colliders[0].points = Some(mesh.points.clone());
    assert_eq!(sheet(&shot, &small(), None, &[1001]).unwrap().rgb, rigid.rgb);
    shot.frames[0].colliders[0].points = Some(points.clone());
    let moved = sheet(&shot, &small(), None, &[1001]).unwrap();
    assert_ne!(moved.rgb, rigid.rgb);
    shot.header.colliders[0].points = points;
    shot.frames[0].colliders[0].points = None;
    assert_eq!(sheet(&shot, &small(), None, &[1001]).unwrap().rgb, moved.rgb);
}

#[test]
fn cache_without_curves_is_bad_input() {
    let mut shot = head_of_hair(0, 1);
    let error = sheet(&shot, &small(), None, &[1001]).unwrap_err();
    assert_eq!(error.exit_code(), 65);
    let Error::BadInput(problems) = error else { panic!("{error}") };
    assert!(problems[0].message.contains("no render strands"), "{}", problems[0].message);
    shot.header.hair = None;
    assert!(sheet(&shot, &small(), None, &[1001]).is_err());
}

#[test]
fn inconsistent_arrays_are_damage_not_a_panic() {
    type Damage = fn(&mut Memory);
    let damages: [Damage; 8] = [
        |s| s.frames[0].hair.as_mut().unwrap().points.truncate(7),
        |s| s.frames[0].hair = None,
        |s| s.header.hair.as_mut().unwrap().widths.truncate(7),
        |s| s.header.hair.as_mut().unwrap().counts[0] = -3,
        |s| s.header.colliders[0].triangles[0][2] = 3,
        |s| s.frames[0].colliders.clear(),
        |s| s.frames[0].colliders[0].points = Some(vec![[0.0; 3]; 2]),
        |s| s.frames[0].hair.as_mut().unwrap().points.fill([f32::NAN; 3]),
    ];
    for damage in damages {
        let mut shot = head_of_hair(20, 1);
        damage(&mut shot);
        let error = sheet(&shot, &small(), None, &[1001]).unwrap_err();
        assert!(matches!(error, Error::Damaged { .. }), "{error}");
    }
}

#[test]
fn nonfinite_points_leave_other_strands_visible() {
    let mut shot = head_of_hair(100, 1);
    shot.frames[0].hair.as_mut().unwrap().points[30] = [f32::NAN, f32::INFINITY, 0.0];
    let image = sheet(&shot, &small(), None, &[1001]).unwrap();
    assert!(image.rgb.iter().any(|c| *c > 60));
}

#[test]
fn options_out_of_range_are_usage_errors() {
    let shot = head_of_hair(10, 1);
    let wrong = [
        Options { size: (0, 10), ..small() },
        Options { supersampling: 0, ..small() },
        Options { fov_deg: f64::NAN, ..small() },
        Options { width_scale: 0.0, ..small() },
        Options { azimuth_deg: f64::INFINITY, ..small() },
    ];
    for options in wrong {
        assert!(matches!(sheet(&shot, &options, None, &[1001]), Err(Error::Usage(_))), "{options:?}");
    }
    assert!(matches!(sheet(&shot, &small(), None, &[]), Err(Error::Usage(_))));
}
