//! What a layer holds, by its name: words of several languages, and habits of offices (A-WALL, A-DOOR, A-GLAZ).

/// What a line of a plan is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// What nobody walks through: walls, windows, columns.
    Wall,
    /// An opening that is counted.
    Door,
    /// An opening by which people leave.
    Exit,
    /// An area where people are at the start.
    Start,
    /// Steps.
    Stair,
    /// A line where a floor goes on at another.
    Link,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 6] = [Self::Wall, Self::Door, Self::Exit, Self::Start, Self::Stair, Self::Link];

    /// Its name in words and options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wall => "wall",
            Self::Door => "door",
            Self::Exit => "exit",
            Self::Start => "start",
            Self::Stair => "stair",
            Self::Link => "link",
        }
    }

    /// The kind of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Words for kinds, lower case, without accents. A name with words of two kinds is of the first of them here: A-DOOR-EXIT is an exit.
const WORDS: [(Kind, &str); 7] = [
    (
        Kind::Exit,
        "exit exits egress ausgang ausgange ausgaenge notausgang notausgange sortie sorties salida salidas uscita uscite saida \
         saidas uitgang uitgangen nooduitgang utgang udgang uloskaynti wyjscie vychod выход 出口",
    ),
    (
        Kind::Start,
        "start starts people person persons occupant occupants crowd personen menschen leute personnes occupants personas personne persone \
         persoane pessoas mensen люди 人",
    ),
    (
        Kind::Door,
        "door doors doorway doorways tur ture turen tuer tueren porte portes puerta puertas porta portas deur deuren dorr dorrar dor dore \
         ovi ovet drzwi dvere дверь двери 门 門 扉",
    ),
    (
        Kind::Stair,
        "stair stairs stairway staircase strs treppe treppen treppenhaus escalier escaliers escalera escaleras scala scalinata escada escadas \
         trap trappen trappa trapp schody лестница 楼梯 階段",
    ),
    // People walk through no window, and walls end at them.
    (
        Kind::Wall,
        "window windows wind glaz glazing fenster fenetre fenetres ventana ventanas finestra finestre janela janelas raam ramen column columns \
         col cols pillar pillars stutze stutzen stuetze stuetzen poteau poteaux pilar pilares pilastro pilastri kolom",
    ),
    (
        Kind::Wall,
        "wall walls partition partitions wand wande waende mauer mauern mur murs cloison cloisons pared paredes muro muros muri parete pareti \
         parede paredes tabique muur muren wanden vagg vaggar vaeg vegg vegger seina seinat sciana sciany stena steny стена стены 墙 壁",
    ),
    // In German "links" is to the left.
    (Kind::Link, "link enlace enlaces collegamento collegamenti ligacao ligacoes"),
];

/// Ends of compounds, as in Innenwand. Of doors "tür" alone: Struktur is none.
const ENDS: [(Kind, &str); 6] = [
    (Kind::Exit, "ausgang"),
    (Kind::Exit, "ausgange"),
    (Kind::Door, "tuer"),
    (Kind::Door, "tueren"),
    (Kind::Wall, "wand"),
    (Kind::Wall, "wande"),
];

/// The kind that names say, from the first one on, and which of them. Those that are `given` come before all others.
pub fn of(names: &[String], hidden: bool, given: &[(Kind, String)]) -> (Option<Kind>, Option<usize>) {
    for (k, name) in names.iter().enumerate() {
        let same = |other: &str| name.to_lowercase() == other.to_lowercase();
        if let Some((kind, _)) = given.iter().find(|(_, other)| same(other)) {
            return (Some(*kind), Some(k));
        }
    }
    if hidden {
        return (None, None);
    }
    for (k, name) in names.iter().enumerate() {
        if let Some(kind) = said(name).filter(|kind| given.iter().all(|(other, _)| other != kind)) {
            return (Some(kind), Some(k));
        }
    }
    (None, None)
}

/// The kind that a name says.
fn said(name: &str) -> Option<Kind> {
    // With the umlaut spelled out, which parts Haustür from Struktur.
    let found = [words(name), words(&name.to_lowercase().replace("u\u{308}", "ue").replace('ü', "ue"))].concat();
    let whole = WORDS.iter().find(|(_, list)| list.split_whitespace().any(|word| found.iter().any(|own| own == word)));
    let end = || ENDS.iter().find(|(_, end)| found.iter().any(|own| own.len() > end.len() + 2 && own.ends_with(end)));
    whole.or_else(end).map(|(kind, _)| *kind)
}

/// Words of a name: parted by all that is no letter, and where a small letter meets a capital; lower case, without accents.
fn words(name: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    let mut small = false;
    for c in name.chars() {
        if ('\u{300}'..='\u{36f}').contains(&c) {
            continue;
        }
        if !c.is_alphabetic() || (small && c.is_uppercase()) {
            found.push(String::new());
        }
        small = c.is_lowercase();
        if c.is_alphabetic()
            && let Some(word) = found.last_mut()
        {
            word.extend(c.to_lowercase().map(plain));
        }
    }
    found.retain(|word| !word.is_empty());
    found
}

/// A letter without its accent.
fn plain(c: char) -> char {
    match c {
        'à'..='å' => 'a',
        'ç' | 'ć' | 'č' => 'c',
        'è'..='ë' | 'ě' | 'ę' => 'e',
        'ì'..='ï' => 'i',
        'ñ' | 'ń' => 'n',
        'ò'..='ö' | 'ø' => 'o',
        'ś' | 'š' => 's',
        'ù'..='ü' | 'ů' => 'u',
        'ý' | 'ÿ' => 'y',
        'ž' | 'ż' | 'ź' => 'z',
        _ => c,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_layers_say_what_they_hold() {
        let expected = [
            ("A-WALL-FULL", Some(Kind::Wall)),
            ("walls", Some(Kind::Wall)),
            ("wall_3", Some(Kind::Wall)),
            ("IfcWall", Some(Kind::Wall)),
            ("Außenwände", Some(Kind::Wall)),
            ("Wa\u{308}nde", Some(Kind::Wall)),
            ("A-GLAZ", Some(Kind::Wall)),
            ("MURS EXT", Some(Kind::Wall)),
            ("A-DOOR", Some(Kind::Door)),
            ("Türen", Some(Kind::Door)),
            ("Haustür", Some(Kind::Door)),
            ("Puertas", Some(Kind::Door)),
            ("A-DOOR-EXIT", Some(Kind::Exit)),
            ("Notausgang 2", Some(Kind::Exit)),
            ("Sortie de secours", Some(Kind::Exit)),
            ("Start area", Some(Kind::Start)),
            ("A-FLOR-STRS", Some(Kind::Stair)),
            ("Treppen", Some(Kind::Stair)),
            ("Link west", Some(Kind::Link)),
            ("Wand links", Some(Kind::Wall)),
            ("Tür links", Some(Kind::Door)),
            ("Treppe Link", Some(Kind::Stair)),
            ("0", None),
            ("Defpoints", None),
            ("wallpaper", None),
            ("A-ANNO-TEXT", None),
            ("Struktur", None),
        ];
        for (name, kind) in expected {
            assert_eq!(said(name), kind, "{name}");
        }
    }

    #[test]
    fn layers_that_are_given_are_the_only_ones_of_their_kind() {
        let given = [(Kind::Wall, "new".to_owned())];
        let of = |name: &str, hidden: bool| of(&[name.to_owned()], hidden, &given).0;
        assert_eq!(of("NEW", false), Some(Kind::Wall));
        assert_eq!(of("NEW", true), Some(Kind::Wall));
        assert_eq!(of("A-WALL", false), None);
        assert_eq!(of("A-DOOR", false), Some(Kind::Door));
        assert_eq!(of("A-DOOR", true), None);
    }
}
